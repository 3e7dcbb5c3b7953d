"""The process with the MQTT client as a thread whose loop is counted: it must never be busy for nothing."""

import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from drivers.mqtt_client import Process
from tests.drivers.mqtt_station import Station, settings

Start = Callable[..., Station]

CONNACK = bytes.fromhex("2003000000")
SUBACK = bytes.fromhex("900400010001")


@pytest.fixture
def turns(monkeypatch) -> list[int]:
    """How often each loop has turned."""
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
    # 1000 a second is what a loop needs that carries 500 messages; one that is busy for nothing turns 100,000 times.
    assert len(turns) < 200 + 1000 * (time.monotonic() - before), "a busy loop"


def idles(station: Station, seconds: float, turns: list[int]) -> None:
    """Nothing happens, and nothing is done."""
    turns.clear()
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        station.read(left)
    assert len(turns) < 30 * (1 + seconds), turns


def answering(octets: bytes, more: bytes = b"") -> Callable[[socket.socket, threading.Event], None]:
    """A broker that answers CONNECT and SUBSCRIBE in such octets."""

    def serve(line: socket.socket, _over: threading.Event) -> None:
        line.recv(1000)
        line.sendall(octets)
        if more:
            line.recv(1000)
            line.sendall(more)
        while line.recv(1000):
            pass

    return serve
