"""captain doctor: pulses, chronyd's socket and leap seconds."""

import errno
import os
import socket
from pathlib import Path
from typing import Any

import pytest

from board.time.scales import LEAPS_END
from firmware.config import captain_toml
from firmware.doctor import clock as time_checks
from firmware.doctor.finding import Finding, Level
from tests.said import tells

NOW = 1_795_182_426.0
GNSS = '[interfaces.gnss]\ndriver = "zed_f9p"\nport = "/dev/ttyAMA0"\n'
OK, WARNING, PROBLEM = Level.OK, Level.WARNING, Level.PROBLEM


def found(
    folder: Path, text: str = "", pulse: str = 'device = "/dev/none"', running: Any = None, now: float = NOW
) -> dict[str, Finding]:
    board, file = folder / "board.toml", folder / "captain.toml"
    board.write_text('name = "a"\n' + (f"[pulse]\n{pulse}\n" if pulse else ""))
    file.write_text(text)
    read = captain_toml.load(str(file), (), str(board))
    return {one.subject: one for one in time_checks.time(read, running, now)}


def test_pulses_without_a_receiver_are_reported_as_not_used(tmp_path: Path) -> None:
    assert found(tmp_path, pulse="") == {}
    told = found(tmp_path)
    assert (list(told), told["pulses"].level) == (["pulses"], OK)
    assert tells(told["pulses"].text, "/dev/none ", "not used", "no interface")


def test_pulse_input_that_is_absent_is_a_warning_with_its_overlay(tmp_path: Path) -> None:
    pulses = found(tmp_path, GNSS)["pulses"]
    assert pulses.level is WARNING
    assert tells(pulses.text, f"/dev/none: {os.strerror(errno.ENOENT)}; ", "messages")
    assert "pps-gpio" in pulses.remedy


def test_a_device_that_is_no_input_for_pulses_is_a_problem(tmp_path: Path) -> None:
    for device in ("/dev/null", "/dev", "/etc/passwd"):
        assert found(tmp_path, GNSS, f'device = "{device}"')["pulses"].level is PROBLEM


def test_a_chip_that_is_not_there_is_a_warning(tmp_path: Path) -> None:
    assert found(tmp_path, GNSS, 'chip = "gpiochip99"\noffset = 18')["pulses"].level is WARNING


def test_a_running_station_is_asked_in_place_of_the_input(tmp_path: Path) -> None:
    clock = {"state": "locked", "uncertainty_ns": 5000, "leap": {"table": "receiver"}, "pulse": {"why": ""}}
    told = found(tmp_path, GNSS, running={"clock": clock})
    assert [(one.subject, one.level) for one in told.values()] == [("time", OK)]
    clock |= {"state": "coarse", "pulse": {"why": "/dev/pps0: gone", "hint": "load it"}}
    told = found(tmp_path, GNSS, running={"clock": clock})
    assert (told["pulses"].level, told["pulses"].remedy) == (WARNING, "load it")
    assert (told["time"].level, told["time"].remedy) == (WARNING, "`captain time` says more")


def test_socket_of_chronyd_that_is_absent_or_forbidden_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "chrony.sock"
    text = f'[time]\nchrony = "{path}"\n'
    assert "refclock SOCK" in found(tmp_path, text)["chrony"].remedy
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as chronyd:
        chronyd.bind(str(path))
        assert found(tmp_path, text)["chrony"].level is OK
        monkeypatch.setattr(os, "access", lambda *_: False)
        forbidden = found(tmp_path, text)["chrony"]
        assert forbidden.level is not OK
        assert tells(forbidden.text, str(path), "not be written", "user")


def test_what_is_no_socket_of_chronyd_is_none(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "file"):
        assert found(tmp_path, f'[time]\nchrony = "{path}"\n')["chrony"].level is PROBLEM
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as left:
        left.bind(str(tmp_path / "left"))
    told = found(tmp_path, f'[time]\nchrony = "{tmp_path}/left"\n')["chrony"]
    assert (told.level, "Connection refused" in told.text) == (WARNING, True)


def test_a_list_of_leap_seconds_that_cannot_be_used_is_a_warning(tmp_path: Path) -> None:
    told = found(tmp_path, f'[time]\nleap_list = "{tmp_path}/none"\n{GNSS}')["leap seconds"]
    assert (told.level, "cannot be read" in told.text) == (WARNING, True)
    assert found(tmp_path, f'[time]\nleap_list = ""\n{GNSS}')["leap seconds"].level is WARNING  # it has expired
    assert found(tmp_path, f'[time]\nleap_list = ""\n{GNSS}', now=LEAPS_END - 1.0)["leap seconds"].level is OK
