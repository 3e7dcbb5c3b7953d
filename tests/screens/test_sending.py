"""Screens of send, replay, swarm and impair: all sent, some refused, none received."""

import socket
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from firmware.commands import impair, swarm
from firmware.lab.laboratory import vectors
from firmware.recordings import capture
from firmware.replay import ears
from firmware.replay.bridge import Way
from firmware.swarm.swarm import Swarm
from tests.firmware.commands.fake import FakeStation
from tests.firmware.commands.test_replay import BEACON
from tests.firmware.commands.test_send import confirm, sent_by
from tests.firmware.replay.test_rewriting import frame_of
from tests.screens.terminal import Terminal, compare

PDUS = {vector.name: vector.pdu for vector in vectors()}
CAM, DENM = PDUS["cam 46"], PDUS["denm 404"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Working folder with files of messages, so that paths are short."""
    monkeypatch.chdir(tmp_path)
    Path("three.hex").write_text(f"{CAM.hex()}\nno message\n{CAM.hex()}\n")
    frames = [frame_of(CAM), frame_of(DENM), BEACON, frame_of(CAM)[:50]]
    records = (capture.record(one, 10**18 + at * 10**6) for at, one in enumerate(frames))
    Path("drive.pcap").write_bytes(capture.header() + b"".join(records))


def second_dropped(options: dict[str, object], number: int) -> list[dict[str, object]]:
    if number != 2:
        return sent_by("g5")(options, number)
    full = confirm(options, "dropped", interface="g5", reason="queue-full", meaning="the queue is full")
    return [confirm(options, "accepted", interfaces=["g5"]), full]


@pytest.fixture
def still(monkeypatch: pytest.MonkeyPatch) -> None:
    """A replay that takes no time."""
    monkeypatch.setattr("firmware.commands.replay.time", SimpleNamespace(monotonic=lambda: 0.0))


def test_a_sent_message_has_a_line_and_a_sum(terminal: Terminal) -> None:
    with FakeStation(answer=sent_by("g5")) as station:
        terminal.run("send", CAM.hex(), *station.options)
    compare("send", terminal.lines())


def test_send_with_an_invalid_and_a_dropped_message_ends_with_the_error(terminal: Terminal) -> None:
    with FakeStation(answer=second_dropped) as station:
        terminal.run("send", "three.hex", "--rate", "0", *station.options)
    compare("send-bad", terminal.lines())


def test_a_replay_to_a_station_ends_with_its_summary(still: None, terminal: Terminal) -> None:
    with FakeStation(answer=sent_by("g5")) as station:
        terminal.run("replay", "drive.pcap", "--rate", "0", *station.options)
    compare("replay", terminal.lines())


def test_replay_with_a_dropped_message_ends_with_the_error(still: None, terminal: Terminal) -> None:
    with FakeStation(answer=second_dropped) as station:
        terminal.run("replay", "drive.pcap", "--rate", "0", *station.options)
    compare("replay-bad", terminal.lines())


def test_replay_of_an_absent_file_ends_with_the_error(still: None, terminal: Terminal) -> None:
    terminal.run("replay", "absent.pcap", "--udp", "127.0.0.1:9")
    compare("replay-absent", terminal.lines())


class StillSwarm(Swarm):
    """A swarm in virtual time."""

    def __init__(self, *given: Any, sleep: object) -> None:
        self.now = 0.0
        super().__init__(*given, clock=lambda: self.now, sleep=self.wait)

    def wait(self, left: float) -> None:
        self.now += left


@pytest.fixture
def still_swarm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(swarm, "Swarm", StillSwarm)
    monkeypatch.setattr(swarm, "_cpu_s", lambda: 0.0)


def test_a_swarm_ends_with_a_summary(still_swarm: None, terminal: Terminal) -> None:
    with FakeStation(answer=sent_by("g5")) as station:
        terminal.run("swarm", "3", "--rate", "10", "--duration", "0.5", "--endpoint", *station.options)
    compare("swarm", terminal.lines())


def test_a_swarm_of_which_messages_were_dropped_ends_with_the_error(still_swarm: None, terminal: Terminal) -> None:
    with FakeStation(answer=second_dropped) as station:
        terminal.run("swarm", "3", "--rate", "10", "--duration", "0.5", "--endpoint", *station.options)
    compare("swarm-bad", terminal.lines())


def test_swarm_to_an_address_without_a_receiver_ends_with_the_error(still_swarm: None, terminal: Terminal) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as closed:
        closed.bind(("127.0.0.1", 0))
        to = "{}:{}".format(*closed.getsockname())
    terminal.run("swarm", "2", "--rate", "10", "--duration", "0.3", "--udp", to)
    compare("swarm-unheard", terminal.lines())


class StillBridge:
    """A bridge that has passed on some messages; its ways are those of the command."""

    def __init__(self, ways: list[Way]) -> None:
        self._ways = ways

    def run(self, duration: float | None) -> None:
        there, back = self._ways
        there.heard, there.sent = 1200, 1075
        there.impairment.counts.taken, there.impairment.counts.lost = 1200, 125
        back.left_out["GeoNetworking: 36 octets end before their headers do (first station 4711)"] = 3


def test_a_lossy_link_ends_with_the_counts_of_both_ways(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(impair, "Bridge", StillBridge)
    monkeypatch.setattr(ears, "Datagrams", lambda *_: SimpleNamespace(missed=0, close=lambda: None))
    terminal.run("impair", "udp::29001,:8947", "udp::29002,:8948", "--loss", "0.1", "--delay", "0.05")
    compare("impair", terminal.lines())


def test_an_impossible_lossy_link_ends_with_the_error(terminal: Terminal) -> None:
    terminal.run("impair", "udp::29001,:29002", "udp::29003,:29001")
    compare("impair-bad", terminal.lines())
