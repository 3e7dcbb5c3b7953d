"""Replay into another station: its users receive the same octets as those of the first."""

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from board.runtime.errors import ProtocolError
from firmware.recordings import capture
from firmware.recordings.pcapng import Direction
from tests.system.air import GEONETWORKING, NEIGHBOUR
from tests.system.conftest import Bench, Launcher
from tests.system.recordings import tshark_opens
from tests.system.station import BETWEEN, PATIENCE, PROGRAM, ROOT
from tests.system.user import Received, mark

NOT_OF_THE_MESSAGE = ("sec", "usec")  # time of reception, which differs in a replay


def frame(pdu: bytes, number: int, area: bool = False) -> bytes:
    """Return a frame of a station whose address, place and traffic class depend on number; with area, a GeoBroadcast."""
    from drivers.message import Area, Ego, MessageType, Position, Request, Shape
    from drivers.wire import frame as ethernet
    from drivers.wire.geonet.sender import Sender

    mac = bytes.fromhex("02000000a0") + bytes((number,))
    place = Position(487_668_616 + number * 1000, 114_320_680 - number * 1000)
    shape = Area(Shape(number % 3), place, 500 + number, 100, 45) if area else None
    request = Request(0, MessageType("", pdu[1], 2001, 0, 0), pdu, 2001 + number, 0.0, 60.0, 0, number % 4, shape, 3)
    ego = Ego(700_000_000_000 + number, place, True, 1000 + number, 900)
    return ethernet.wrap(mac, Sender(mac).encode(request, 0.0, ego))


@pytest.fixture
def on_air(frames: dict[str, bytes], vectors: list[dict[str, Any]]) -> list[bytes]:
    """Return an independent station's frames, all message types by both transports, and frames that are dropped."""
    made = [frame(row["pdu"], at, area) for area in (False, True) for at, row in enumerate(vectors)]
    return [*frames.values(), *made, made[-1], made[0][:40], b"\xff" * 12 + b"\x89\x47"]


@contextmanager
def recorded(bench: Bench, path: Path, count: int) -> Iterator[None]:
    """Record a station during a block. At the end the file must contain `count` frames."""
    reports = bench.station.ports["report"]
    child = subprocess.Popen(
        [*PROGRAM, "record", "--pcapng", str(path), "--report", str(reports)], stderr=subprocess.PIPE
    )
    assert child.stderr is not None
    with child, child.stderr:
        while b"a station is heard" not in (line := child.stderr.readline()):
            assert line, "the recorder has ended"
        yield
        end = time.monotonic() + PATIENCE
        while frames_in(path) < count:
            assert time.monotonic() < end, f"{frames_in(path)} frames of {count}"
            time.sleep(BETWEEN)
        child.send_signal(signal.SIGTERM)
        assert child.wait(PATIENCE) == 0


def frames_in(path: Path) -> int:
    with path.open("rb") as stream:
        try:
            return sum(one.direction is Direction.IN for one in capture.frames(stream.read(4), stream))
        except ProtocolError:
            return 0  # the last block of the file is incomplete


def replay(*arguments: str) -> dict[str, Any]:
    done = subprocess.run(
        [*PROGRAM, "replay", "--json", *arguments], capture_output=True, timeout=4 * PATIENCE, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    told: dict[str, Any] = json.loads(done.stdout)
    return told


def indications(bench: Bench, count: int) -> list[tuple[bytes, bytes, dict[str, Any]]]:
    """Return envelope, PDU and all facts of each received message except its time of reception."""
    found = [bench.user.receive() for _ in range(count)]
    bench.user.hears_nothing_before_a_mark(bench.air)
    return [_described(one) for one in found]


def by_type(found: list[tuple[bytes, bytes, dict[str, Any]]]) -> list[tuple[bytes, bytes, dict[str, Any]]]:
    return sorted(found, key=lambda one: one[0])


def _described(one: Received) -> tuple[bytes, bytes, dict[str, Any]]:
    known = {key: value for key, value in one.fields.items() if key not in NOT_OF_THE_MESSAGE}
    return one.envelope, one.pdu, known


def test_a_recording_replayed_into_a_second_station_gives_byte_identical_indications(
    launch: Launcher, on_air: list[bytes], tmp_path: Path
):
    first, second = launch("ethernet"), launch("ethernet")
    path = tmp_path / "drive.pcapng"
    with recorded(first, path, len(on_air)):
        for octets in on_air:
            first.air.throw(octets)
    first.air.send(last := mark())
    expected = []
    while (one := first.user.receive()).pdu != last:
        expected.append(_described(one))
    assert len(expected) >= 24
    told = replay(str(path), "--udp", "{}:{}".format(*second.air.station))
    assert told["read"] == told["sent"] == len(on_air)
    # Each type has its own reception queue, so the order of two types may change.
    assert by_type(indications(second, len(expected))) == by_type(expected)


# First octets of the CAMs in captures/air.json, and the positions of their stations.
REAL = {
    "02029c6bc793": (535505166, 99353789),
    "0202bb4301ae": (0x1C7F0B41, 0x07C7FF4B),
    "020200c39035": (0x1C7F7BB8, 0x07D72553),
}


@pytest.fixture
def real(tmp_path: Path) -> Path:
    """Return a folder with captures of real stations: one with radiotap, one with Ethernet headers added."""
    rows = json.loads((ROOT / "tests" / "captures" / "air.json").read_text())["frames"]
    around = b"\xff" * 6 + NEIGHBOUR + GEONETWORKING.to_bytes(2)
    files: dict[int, list[bytes]] = {}
    for row in rows:
        octets = bytes.fromhex(row["hex"])
        files.setdefault(row["link"] or capture.ETHERNET, []).append(octets if row["link"] else around + octets)
    folder = tmp_path / "real"
    folder.mkdir()
    for link, frames in files.items():
        written = capture.header()[:-4] + link.to_bytes(4, "little")
        written += b"".join(capture.record(one, 10**18 + at) for at, one in enumerate(frames))
        (folder / f"{link}.pcap").write_bytes(written)
    return folder


def test_what_real_stations_sent_is_replayed_recorded_and_replayed_again(launch: Launcher, real: Path, tmp_path: Path):
    first, second = (launch("ethernet") for _ in range(2))
    path = tmp_path / "drive.pcapng"
    with recorded(first, path, 4):
        assert replay(str(real), "--udp", "{}:{}".format(*first.air.station))["sent"] == 4
    expected = indications(first, 3)
    assert {pdu[:6].hex(): (known["latitude"], known["longitude"]) for _, pdu, known in expected} == REAL
    tshark_opens(path, made_up=())
    replay(str(path), "--udp", "{}:{}".format(*second.air.station))
    assert indications(second, 3) == expected


def test_the_vectors_replayed_to_the_endpoint_leave_as_they_are(launch: Launcher, vectors: list[dict[str, Any]]):
    bench = launch("ethernet")
    folder = Path(capture.__file__).parents[1]
    ports = bench.station.ports
    first = ["--station", f"127.0.0.1:{ports['from_users']}"]
    others = [
        word for name in ("to_users", "pull", "report") for word in (f"--{name.replace('_', '-')}", str(ports[name]))
    ]
    told = replay(str(folder / "vectors.json"), "--rate", "200", *first, *others)
    assert told["outcomes"] == {"sent": len(vectors)}
    assert [bench.air.hear().pdu for _ in vectors] == [row["pdu"] for row in vectors]


def test_a_bad_way_loses_exactly_what_it_counts(launch: Launcher, vectors: list[dict[str, Any]], tmp_path: Path):
    bench = launch("pdu")
    path = tmp_path / "many.hex"
    path.write_text("\n".join((vectors[at % 12]["pdu"][:6] + at.to_bytes(4)).hex() for at in range(500)))
    listens = "{}:{}".format(*bench.air.station)
    told = replay(
        str(path), "--rate", "2000", "--udp", listens, "--framing", "pdu", "--loss", "0.2", "--duplicate", "0.1"
    )
    way = told["way"]
    assert (way["taken"], told["sent"]) == (500, 500 - way["lost"] + way["duplicated"])
    assert 60 < way["lost"] < 140
    got = [bench.user.receive().pdu for _ in range(told["sent"])]
    assert len(set(got)) == 500 - way["lost"]
