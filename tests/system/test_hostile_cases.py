"""Attacks on a running station's ports: it serves others, counts the attack, frees resources."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.attack.attacks import ATTACKS
from tests.system.conftest import Bench, Launcher
from tests.system.station import ROOT, Station
from tests.system.user import mark

MEMORY_KB = 64 * 1024
# Reason under which the station counts the end of each attack; the first attack is not counted.
REASONS = {
    "unsubscribe": "",
    "giant-topic": "",
    "topics": "subscriber-flood",
    "endless-push": "unfinished-message",
    "endless-pub": "unfinished-message",
    "endless-sub": "subscriber-flood",
    "empty-parts": "unfinished-message",
    "idle": "connections",
    "slow": "subscriber-cut",
}
FILL = bytes(1390)
# Each message goes to every subscriber until it is cut, and 200 take 20 s of processor time; `make attack` has so many.
CONNECTIONS = {"slow": (40,)}
ROUNDS = 20  # number of rounds during an attack that is not counted


def test_every_attack_has_a_row() -> None:
    assert REASONS.keys() == ATTACKS.keys()


@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_costs_the_attacker_alone(launch: Launcher, name: str) -> None:
    bench = launch("pdu")
    station = bench.station
    assert station.child is not None
    descriptors, memory_kb = descriptors_of(station), station.status()["memory_kb"]
    port = ATTACKS[name][1][0]
    rounds, peak_kb = 0, memory_kb
    with attack(name, station.ports[port]):
        while rounds < ROUNDS or (REASONS[name] and not counted(station, port, REASONS[name])):
            serve(bench)
            peak_kb = max(peak_kb, station.status()["memory_kb"])
            rounds += 1
    assert station.running
    assert peak_kb - memory_kb < MEMORY_KB
    serve(bench)
    station.until(lambda _: descriptors_of(station) <= descriptors)
    ended = {reason for where, reason in station.drops() if where in ("from_users", "pull", "to_users", "report")}
    assert ended - {"topics", "subscriber-slow"} == ({REASONS[name]} if REASONS[name] else set())


def serve(bench: Bench) -> None:
    """Send ten long messages each way and check that all arrive."""
    for _ in range(10):
        bench.air.send(pdu := mark() + FILL)
        assert bench.user.receive().pdu == pdu
        bench.user.push_pdu(b"v2x.cam.", pdu := mark() + FILL)
        assert bench.air.hear().pdu == pdu


def counted(station: Station, where: str, reason: str) -> int:
    return station.drops().get((where, reason), 0)


def descriptors_of(station: Station) -> int:
    assert station.child is not None
    return len(os.listdir(f"/proc/{station.child.pid}/fd"))


@contextmanager
def attack(name: str, port: int) -> Iterator[None]:
    """Run an attacking process with low priority around a block."""
    numbers = map(str, (port, *CONNECTIONS.get(name, ())))
    command = [sys.executable, "-m", "tests.attack.attacks", name, *numbers]
    with subprocess.Popen(command, cwd=Path(ROOT), stderr=subprocess.DEVNULL) as running:
        try:
            yield
        finally:
            running.kill()
