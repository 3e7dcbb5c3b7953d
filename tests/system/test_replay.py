"""A recording, replayed into another station: its users get what the first one's got, octet for octet."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from firmware.codec import capture
from firmware.codec.pcapng import Direction, Pcapng
from tests.system.conftest import Bench, Launcher
from tests.system.station import PATIENCE, PROGRAM
from tests.system.user import Received

NOT_OF_THE_MESSAGE = ("sec", "usec")  # of reception: it is another moment


def frame(pdu: bytes, number: int, area: bool = False) -> bytes:
    """Of stations with places and classes of their own; with an area a GeoBroadcast."""
    from drivers.message import Area, Ego, MessageType, Position, Request, Shape
    from drivers.wire import frame as ethernet
    from drivers.wire.geonet_sender import Sender

    mac = bytes.fromhex("02000000a0") + bytes((number,))
    place = Position(487_668_616 + number * 1000, 114_320_680 - number * 1000)
    shape = Area(Shape(number % 3), place, 500 + number, 100, 45) if area else None
    request = Request(0, MessageType("", pdu[1], 2001, 0, 0), pdu, 2001 + number, 0.0, 60.0, 0, number % 4, shape, 3)
    ego = Ego(700_000_000_000 + number, place, True, 1000 + number, 900)
    return ethernet.wrap(mac, Sender(mac).encode(request, 0.0, ego))


@pytest.fixture
def on_air(frames: dict[str, bytes], vectors: list[dict[str, Any]]) -> list[bytes]:
    """An independent station's frames, all message types by both transports, and what a station drops."""
    made = [frame(row["pdu"], at, area) for area in (False, True) for at, row in enumerate(vectors)]
    return [*frames.values(), *made, made[-1], made[0][:40], b"\xff" * 12 + b"\x89\x47"]


def pcapng(path: Path, frames: list[bytes]) -> Path:
    with path.open("wb") as stream:
        recording = Pcapng(stream, "test")
        for at, one in enumerate(frames):
            recording.add("g5", 10**18 + at * 2_000_000, one, Direction.IN)
    return path


def replay(*arguments: str) -> dict[str, Any]:
    done = subprocess.run(
        [*PROGRAM, "replay", "--json", *arguments], capture_output=True, timeout=4 * PATIENCE, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    told: dict[str, Any] = json.loads(done.stdout)
    return told


def indications(bench: Bench, count: int) -> list[tuple[bytes, bytes, dict[str, Any]]]:
    """Envelope, PDU and all that is known of each message but the moment when it was received."""
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
    for octets in on_air:
        first.air.throw(octets)
    expected = [_described(first.user.receive())]
    first.air.send(last := b"\2\2\0\0\0\7end")
    while (one := first.user.receive()).pdu != last:
        expected.append(_described(one))
    assert len(expected) >= 24
    listens = "{}:{}".format(*second.air.station)
    told = replay(str(pcapng(tmp_path / "drive.pcapng", on_air)), "--udp", listens)
    assert told["read"] == told["sent"] == len(on_air)
    # Types have lanes: what came first of two types may be delivered after the other.
    assert by_type(indications(second, len(expected))) == by_type(expected)


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
