"""Recordings from outside: captain record, and the process of [recorder]."""

import io
import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from firmware.recordings import capture
from firmware.recordings.layers import Carried, open_frame
from firmware.recordings.pcapng import Direction
from tests.system.air import framed
from tests.system.conftest import Launcher
from tests.system.station import BETWEEN, PATIENCE, PROGRAM, ROOT, Station
from tests.system.user import mark

VECTORS = [
    (row["type"], bytes.fromhex(row["hex"])) for row in json.loads((ROOT / "firmware" / "vectors.json").read_text())
]
KINDS = {"eth": "ethernet", "btp": "btp", "pdu": "pdu"}
PORTS = {"denm": 2002, "cam": 2001, "spatem": 2004, "mapem": 2003, "ivim": 2006}
RING = {"in_memory": True, "before_s": 30.0, "after_s": 0.1}


def frames(path: Path) -> list[capture.Frame]:
    octets = path.read_bytes()
    return list(capture.frames(octets[:4], io.BytesIO(octets[4:])))


def shown(path: Path, *fields: str) -> list[list[str]]:
    """Return fields that tshark prints for a file, one row for each frame."""
    command = ["tshark", "-n", "-r", str(path), "-T", "fields", *(f"-e{field}" for field in fields)]
    ended = subprocess.run(command, capture_output=True, text=True, check=True, timeout=4 * PATIENCE)
    return [line.split("\t") for line in ended.stdout.splitlines()]


@contextmanager
def recorder(station: Station, path: Path) -> "Iterator[subprocess.Popen[str]]":
    """Run `captain record` around a block, which begins once it receives from the station."""
    command = [*PROGRAM, "record", "--pcapng", str(path), "--station", f"127.0.0.1:{station.ports['from_users']}"]
    command += ["--report", str(station.ports["report"])]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as running:
        try:
            assert running.stderr is not None
            assert running.stderr.readline() == f"captain: a station is heard at 127.0.0.1:{station.ports['report']}\n"
            yield running
            running.send_signal(signal.SIGTERM)
            assert running.wait(PATIENCE) == 0
            assert ", 0 lost" in running.stderr.read()
        finally:
            running.kill()


def until_recorded(path: Path, pdu: bytes, again: Callable[[], None] = lambda: None) -> None:
    """Wait until a growing recording contains a PDU; again() sends it repeatedly."""
    end = time.monotonic() + PATIENCE
    while pdu not in path.read_bytes():
        assert time.monotonic() < end, "it was not recorded"
        again()
        time.sleep(BETWEEN)


def test_every_message_of_every_framing_is_in_the_recording_and_tshark_reads_it(
    launch: Launcher, tmp_path: Path
) -> None:
    bench, path = launch(interfaces=KINDS), tmp_path / "a.pcapng"
    sent = [(kind, pdu) for kind, pdu in VECTORS if kind in PORTS]
    pdus = sorted(pdu for _, pdu in sent)
    with recorder(bench.station, path):
        for air in bench.airs.values():
            for kind, pdu in sent:
                air.throw(framed(air.framing, pdu, PORTS[kind]))
        for kind, pdu in sent:
            bench.user.send(f"v2x.{kind}.".encode(), pdu)
        last = mark()
        bench.user.send(b"v2x.cam.", last)
        for air in bench.airs.values():
            while air.hear().pdu != last:
                pass
        until_recorded(path, last)
    found = frames(path)
    for name in KINDS:
        of_it = [frame for frame in found if frame.interface == name]
        for direction in (Direction.IN, Direction.OUT):
            went = [opened(frame) for frame in of_it if frame.direction is direction]
            assert sorted(pdu for pdu in went if pdu in pdus) == pdus
        assert {frame.said["is_made_up"] for frame in of_it} == {name != "eth"}
    assert {frame.said.get("reason") for frame in found} == {None, "duplicate"}
    assert found[0].recording["version"]
    rows = shown(path, "_ws.malformed", "frame.comment", "frame.interface_name", "frame.protocols")
    assert len(rows) == len(found)
    for (malformed, comment, interface, protocols), frame in zip(rows, found, strict=True):
        assert (interface, comment) == (frame.interface, frame.comment)
        assert protocols.startswith("eth:ethertype:gnw")
        assert not malformed or opened(frame) not in pdus  # marks are not valid CAMs


def opened(frame: capture.Frame) -> bytes:
    carried = open_frame(frame.link, frame.octets)
    return carried.pdu if isinstance(carried, Carried) else b""


def test_a_frame_goes_into_the_recording_as_it_came(launch: Launcher, tmp_path: Path) -> None:
    bench, path = launch("ethernet"), tmp_path / "a.pcapng"
    octets = framed("ethernet", pdu := mark(), 2001)
    with recorder(bench.station, path):
        bench.air.throw(octets)
        until_recorded(path, pdu)
    assert octets in [frame.octets for frame in frames(path)]


def test_a_station_that_starts_again_is_recorded_on(launch: Launcher, tmp_path: Path) -> None:
    bench, path = launch("ethernet"), tmp_path / "a.pcapng"
    with recorder(bench.station, path):
        for _ in range(2):
            until_recorded(path, pdu := mark(), partial(bench.air.send, pdu))
            bench.station.stop()
            bench.station.start()
            bench.user.join(bench.air)
        until_recorded(path, pdu := mark(), partial(bench.air.send, pdu))
    found = frames(path)
    assert len({frame.recording["pid"] for frame in found}) == 3
    assert sum(frame.lost for frame in found) == 0


def is_recording(status: dict[str, Any]) -> bool:
    return bool(status["recorder"].get("file"))


def ring(folder: Path, kind: str = "") -> list[capture.Frame]:
    return [frame for path in sorted(folder.glob(f"{kind}*.pcapng")) for frame in frames(path)]


def test_the_station_keeps_a_ring_and_what_was_before_an_event(launch: Launcher, tmp_path: Path) -> None:
    folder = tmp_path / "ring"
    bench = launch("ethernet", recorder={"folder": str(folder), **RING})
    bench.station.until(is_recording)
    denm = next(pdu for kind, pdu in VECTORS if kind == "denm")
    bench.air.send(before := mark())
    bench.air.send(denm, 2002)
    bench.station.until(lambda status: status["recorder"]["kept"] == 1)
    kept = [opened(frame) for frame in ring(folder, "kept-")]
    assert kept.index(before) < kept.index(denm)
    bench.air.send(after := mark())
    bench.station.until(lambda _: any(after in path.read_bytes() for path in folder.glob("*.pcapng")))
    answer = bench.station.ask(do="record", text="near miss")
    assert answer == {"ok": True, "folder": str(folder)}
    bench.station.until(lambda status: status["recorder"]["kept"] == 2)
    assert after in [opened(frame) for frame in ring(folder, "kept-*-near-miss")]


def test_the_last_message_before_the_end_is_in_the_ring(launch: Launcher, tmp_path: Path) -> None:
    folder = tmp_path / "ring"
    bench = launch("ethernet", recorder={"folder": str(folder), **RING})
    bench.station.until(is_recording)
    pdus = [mark() for _ in range(20)]
    for pdu in pdus:
        bench.air.send(pdu)
    bench.user.forget_until(pdus[-1])
    bench.station.stop()
    assert [opened(frame) for frame in ring(folder)] == pdus


def test_a_recorder_that_dies_is_started_again_and_routing_goes_on(launch: Launcher, tmp_path: Path) -> None:
    folder = tmp_path / "ring"
    bench = launch("ethernet", recorder={"folder": str(folder), **RING})
    why = bench.station.until(is_recording)["recorder"]["why"]
    os.kill(int(why.split()[1]), signal.SIGKILL)
    bench.air.send(pdu := mark())
    bench.user.forget_until(pdu)
    bench.station.until(lambda status: status["recorder"]["restarts"] == 1 and status["recorder"]["is_running"])


@pytest.mark.parametrize("question", [{"text": ""}, {"text": 7}, {}])
def test_a_reason_has_to_be_given(launch: Launcher, tmp_path: Path, question: dict[str, Any]) -> None:
    bench = launch("pdu", recorder={"folder": str(tmp_path), **RING})
    assert bench.station.ask(do="record", **question)["error"] == "text: missing reason"


def test_without_a_folder_there_is_no_recorder(launch: Launcher) -> None:
    bench = launch("pdu")
    assert "recorder" not in bench.station.status()
    assert "the station has no recorder" in bench.station.ask(do="record", text="x")["error"]


def test_a_folder_that_is_not_there_is_said_and_routing_goes_on(launch: Launcher, tmp_path: Path) -> None:
    bench = launch("ethernet", recorder={"folder": str(tmp_path / "no" / "card"), **RING})
    status = bench.station.until(lambda status: bool(status["recorder"].get("trouble")))
    assert status["recorder"]["trouble"] == "No such file or directory"
    bench.air.send(pdu := mark())
    bench.user.forget_until(pdu)
    bench.station.until(lambda status: status["recorder"]["lost"] > 0)
    (tmp_path / "no" / "card").mkdir(parents=True)
    bench.station.until(is_recording)
