"""Readiness and the watchdog, as sd_notify(3) has them."""

import os
import socket
from contextlib import closing
from pathlib import Path

import pytest

from firmware.station.notify import ServiceNotice
from tests.virtual import VirtualLoop


class ServiceManager:
    """The other end of $NOTIFY_SOCKET."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self.socket.bind(address)

    def heard(self) -> list[str]:
        texts = []
        while True:
            try:
                texts.append(self.socket.recv(4096).decode())
            except BlockingIOError:
                return texts

    def close(self) -> None:
        self.socket.close()


def test_a_message_reaches_the_manager_on_a_path(tmp_path: Path) -> None:
    with closing(ServiceManager(f"{tmp_path}/notify")) as manager:
        ServiceNotice({"NOTIFY_SOCKET": f"{tmp_path}/notify"}).send("READY=1")
        assert manager.heard() == ["READY=1"]


def test_a_message_reaches_the_manager_on_an_abstract_socket() -> None:
    name = f"captain-test-{os.getpid()}"
    with closing(ServiceManager(f"\0{name}")) as manager:
        ServiceNotice({"NOTIFY_SOCKET": f"@{name}"}).send("READY=1")
        assert manager.heard() == ["READY=1"]


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": ""}, {"NOTIFY_SOCKET": "/nowhere/at/all"}])
def test_without_a_manager_nothing_is_said_and_nothing_fails(environment: dict[str, str]) -> None:
    ServiceNotice(environment).send("READY=1")


def test_a_manager_that_does_not_read_holds_nothing_up(tmp_path: Path) -> None:
    with closing(ServiceManager(f"{tmp_path}/notify")) as manager:
        notice = ServiceNotice({"NOTIFY_SOCKET": f"{tmp_path}/notify"})
        for _ in range(5000):
            notice.send("WATCHDOG=1")
        assert 0 < len(manager.heard()) < 5000


def test_the_watchdog_is_fed_three_times_in_its_time(tmp_path: Path, loop: VirtualLoop) -> None:
    with closing(ServiceManager(f"{tmp_path}/notify")) as manager:
        ServiceNotice({"NOTIFY_SOCKET": f"{tmp_path}/notify", "WATCHDOG_USEC": "3000000"}).watch(loop)
        assert manager.heard() == ["WATCHDOG=1"]
        loop.run_for(9.5)
        assert manager.heard() == ["WATCHDOG=1"] * 9


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"WATCHDOG_USEC": ""},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "-5"},
        {"WATCHDOG_USEC": "²"},
        {"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "1"},
    ],
)
def test_without_a_watchdog_of_ours_none_is_fed(environment: dict[str, str], loop: VirtualLoop) -> None:
    notice = ServiceNotice(environment)
    notice.watch(loop)
    assert notice.watchdog_s == 0.0
    assert loop.delay() is None


def test_a_watchdog_that_names_this_process_is_ours() -> None:
    assert ServiceNotice({"WATCHDOG_USEC": "500000", "WATCHDOG_PID": str(os.getpid())}).watchdog_s == 0.5
