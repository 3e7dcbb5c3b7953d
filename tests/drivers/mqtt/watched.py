"""MQTT process as a thread whose loop turns are counted, to detect busy loops."""

import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from drivers.mqtt.client.process import Process
from tests.drivers.mqtt.station import Station, settings

Start = Callable[..., Station]

CONNACK = bytes.fromhex("2003000000")
SUBACK = bytes.fromhex("900400010001")


@pytest.fixture
def turns(monkeypatch) -> list[int]:
    """Return the list with the number of turns of each loop."""
    counted: list[int] = []
    wait = Process._wait

    def count(process: Process) -> set[int]:
        counted.append(id(process))
        return wait(process)

    monkeypatch.setattr(Process, "_wait", count)
    return counted


@pytest.fixture
def start(turns) -> Iterator[Start]:
    made: list[Station] = []

    def start(port: int, **how) -> Station:
        made.append(Station(settings(f"mqtt://127.0.0.1:{port}", **how)))
        return made[-1]

    before = time.monotonic()
    yield start
    for one in made:
        one.close()
    # A loop that carries 500 messages a second needs 1,000 turns a second; a busy loop has 100,000.
    assert len(turns) < 200 + 1000 * (time.monotonic() - before), "a busy loop"


def idles(station: Station, seconds: float, turns: list[int]) -> None:
    """Check that the loop hardly turns while nothing happens."""
    turns.clear()
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        station.read(left)
    assert len(turns) < 30 * (1 + seconds), turns


def answering(octets: bytes, more: bytes = b"") -> Callable[[socket.socket, threading.Event], None]:
    """Return a broker that answers CONNECT and SUBSCRIBE with the given octets."""

    def serve(line: socket.socket, _over: threading.Event) -> None:
        line.recv(1000)
        line.sendall(octets)
        if more:
            line.recv(1000)
            line.sendall(more)
        while line.recv(1000):
            pass

    return serve
