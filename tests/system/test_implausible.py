"""Implausible messages through a running station: delivered with a mark, then dropped by a row of the policy."""

import json
import signal
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from board.time.scales import gn_timestamp
from firmware import cli
from tests.system.air import HEADERS, single_hop
from tests.system.conftest import Bench, Launcher
from tests.system.user import mark

ANOTHER = bytes.fromhex("02000000000f")
ROW = '\n[[policy]]\nname = "no nonsense"\nmatch.implausible = ["source"]\ninterfaces = []\n'
LATITUDE, NOWHERE = struct.pack(">i", 487668616), struct.pack(">i", 2_147_483_647)


def frame_of(bench: Bench, pdu: bytes) -> bytes:
    """Return a plausible frame, with the station's time as timestamp."""
    return single_hop(pdu, stamp=gn_timestamp(bench.station.status()["clock"]["its_ms"]))


def marks_of(bench: Bench) -> dict[str, int]:
    rows = bench.station.status()["interfaces"]["g5"].get("implausible", [])
    return {row["reason"]: row["count"] for row in rows}


def test_implausible_messages_are_marked_and_a_row_read_by_sighup_drops_them(launch: Launcher) -> None:
    bench = launch("ethernet")
    before = marks_of(bench)
    good = frame_of(bench, mark())
    bad, far = good[:6] + ANOTHER + good[12:], good.replace(LATITUDE, NOWHERE)
    for octets in (good, bad, far):
        bench.air.throw(octets)
        assert bench.user.receive().pdu == good[HEADERS:]
    after = marks_of(bench)
    assert {key: count - before.get(key, 0) for key, count in after.items()} == {
        "source": 1,
        "position": 1,
    } | dict.fromkeys(before, 0)

    bench.station.file.write_text(bench.station.file.read_text() + ROW)
    bench.station.signal(signal.SIGHUP)
    bench.station.until(lambda status: "no nonsense" in [row["name"] for row in status["policy"]])
    bench.air.throw(bad)
    bench.air.throw(far)
    assert bench.user.receive().fields["latitude"] == 2_147_483_647
    assert bench.station.drops() == {("g5", "implausible"): 1}
    assert marks_of(bench)["source"] == 2


def test_indications_have_the_mark_and_their_own_topic(launch: Launcher) -> None:
    bench = launch("ethernet")
    reports = bench.make_reports()
    reports.sub.subscribe(b"implausible.")
    good = frame_of(bench, mark())
    octets = len(good) - HEADERS
    with throwing(bench, good[:6] + ANOTHER + good[12:]):  # repeated, because the first may precede the subscription
        for topic in ("implausible.cam.", "indication.cam."):
            told = reports.next(topic)[1]
            while told.get("implausible") != ["source"]:  # earlier messages, which connected the user, have an old time
                told = reports.next(topic)[1]
            assert (told["octets"], told["interface"]) == (octets, "g5")


def test_listen_shows_the_mark(launch: Launcher, capsys: pytest.CaptureFixture[str]) -> None:
    bench = launch("ethernet")
    good = frame_of(bench, mark())
    ports = bench.station.ports
    command = ["listen", "--station", f"127.0.0.1:{ports['from_users']}", "--to-users", str(ports["to_users"])]
    command += ["--report", str(ports["report"]), "--json", "--count", "1"]
    told: dict[str, object] = {}
    with throwing(bench, good[:6] + ANOTHER + good[12:]):
        while "implausible" not in told:  # the first may precede the subscription
            assert cli.main(command) == 0
            told = json.loads(capsys.readouterr().out)
    assert told["implausible"] == ["source"]


@contextmanager
def throwing(bench: Bench, octets: bytes) -> Iterator[None]:
    """Send a frame repeatedly during a block."""
    is_over = threading.Event()

    def throw() -> None:
        while not is_over.wait(0.05):
            bench.air.throw(octets)

    thread = threading.Thread(target=throw)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()
