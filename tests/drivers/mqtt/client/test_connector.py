"""Connector: the network device of a connection to a broker."""

import errno
import select
import socket
from typing import ClassVar

import pytest

from drivers.mqtt.client import connector as mqtt_connector
from drivers.mqtt.client.connector import Connector
from drivers.mqtt.client.settings import MqttSettings

ELSEWHERE = "192.0.2.1"  # TEST-NET-1 (RFC 5737)
PATIENCE_S = 5.0  # reached only by a test that fails


class Kernel(socket.socket):
    """Socket that records to what it is bound, and sends nothing."""

    bound: ClassVar[list[bytes]] = []
    refusal: ClassVar[OSError | None] = None

    def setsockopt(self, level: int, name: int, value: object, *more: object) -> None:
        if (level, name) == (socket.SOL_SOCKET, socket.SO_BINDTODEVICE):  # TCP has an option of that number, too
            assert isinstance(value, bytes)
            Kernel.bound.append(value)
            if Kernel.refusal:
                raise Kernel.refusal

    def connect(self, address: object) -> None:
        raise OSError(errno.ENETUNREACH, "Network is unreachable")


@pytest.fixture(autouse=True)
def _kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mqtt_connector.socket, "socket", Kernel)
    monkeypatch.setattr(Kernel, "bound", [])
    monkeypatch.setattr(Kernel, "refusal", None)


def tried(host: str, device: str = "", bearer: str = "") -> Connector:
    connector = Connector(MqttSettings(url=f"mqtt://{host}", device=device, plaintext=True), bearer)
    assert select.select([connector], [], [], PATIENCE_S)[0]
    connector.close()
    return connector


@pytest.mark.parametrize(
    ("host", "device", "bearer", "bound"),
    [
        (ELSEWHERE, "", "", []),
        (ELSEWHERE, "", "wwan0", [b"wwan0"]),
        (ELSEWHERE, "eth0", "wwan0", [b"eth0"]),
        ("127.0.0.1", "", "wwan0", []),  # no bearer leads to this machine
        ("127.0.0.1", "lo", "wwan0", [b"lo"]),
    ],
)
def test_it_is_bound_to_what_the_interface_names_or_else_to_its_bearers(
    host: str, device: str, bearer: str, bound: list[bytes]
) -> None:
    tried(host, device, bearer)
    assert Kernel.bound == bound


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (
            errno.EPERM,
            "the station's user may not bind connections to network device wwan0; give the station CAP_NET_RAW",
        ),
        (errno.ENODEV, "device wwan0: No such device"),
    ],
)
def test_a_device_that_cannot_be_used_is_named_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, number: int, words: str
) -> None:
    monkeypatch.setattr(Kernel, "refusal", OSError(number, "No such device"))
    assert words in tried(ELSEWHERE, bearer="wwan0").why_not
