"""Recordings of a station with links of any kind, and their comparison with the original."""

import json
import signal
import subprocess
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from board.runtime.errors import ProtocolError
from firmware.recordings import capture
from firmware.recordings.pcapng import Direction
from tests.system.conftest import Bench
from tests.system.links import Link
from tests.system.station import BETWEEN, PATIENCE, PROGRAM, ROOT, Station
from tests.system.user import Received

PORTS = {"cam": 2001, "denm": 2002, "mapem": 2003, "spatem": 2004, "ivim": 2006, "cpm": 2009, "vam": 2018}
VECTORS = [
    (bytes.fromhex(row["hex"]), PORTS[row["type"]])
    for row in json.loads((ROOT / "firmware" / "vectors.json").read_text())
]
NOT_OF_THE_MESSAGE = ("sec", "usec")  # time of reception, which differs in a replay
EVERYTHING = [word for kind in PORTS for word in ("--type", kind)]  # all messages, but no beacons: their times vary
WORST = 4194304  # severity `note` in tshark, as for a message without a dissector; warnings and errors are higher


class Recorded(NamedTuple):
    """Messages that a station's user received by each interface, and the recordings of them by format."""

    received: Mapping[str, Sequence[Received]]
    files: Mapping[str, Path]

    @property
    def all(self) -> list[Received]:
        return [one for each in self.received.values() for one in each]


def vectors(number: int, link: Link) -> list[tuple[bytes, int]]:
    """Return the vectors that fit on a link, with their ports. `number` makes their stationIDs unique to the link."""
    return [(pdu[:2] + bytes((number,)) + pdu[3:], port) for pdu, port in VECTORS if len(pdu) <= link.longest]


def recorded(bench: Bench, links: Mapping[str, Link], folder: Path) -> Recorded:
    """Send the vectors by each link, one link after the other, and record them in every format."""
    wanted = {name: vectors(number, link) for number, (name, link) in enumerate(links.items())}
    count = sum(map(len, wanted.values()))
    files = {"pcapng": folder / "all.pcapng", "ring": folder / "ring", "mcap": folder / "all.mcap"}
    files["ring"].mkdir()
    received: dict[str, list[Received]] = {}
    with ExitStack() as ending:
        for form, path in files.items():
            options = ["--count", str(count)] if form == "mcap" else []
            ending.enter_context(recorder(bench.station, f"--{form}", path, *options))
        for name, link in links.items():
            for pdu, port in wanted[name]:
                link.send(pdu, port)
            received[name] = [bench.user.receive() for _ in wanted[name]]
            assert sorted(one.pdu for one in received[name]) == sorted(pdu for pdu, _ in wanted[name])
        for form in ("pcapng", "ring"):
            until_there(files[form], count)
    return Recorded(received, files)


@contextmanager
def recorder(station: Station, *options: str | Path) -> Iterator[None]:
    """Run `captain record` around a block, which begins once it receives from the station."""
    words = map(str, (*PROGRAM, "record", *options, *addresses(station), *EVERYTHING))
    with subprocess.Popen([*words], stderr=subprocess.PIPE) as child:
        try:
            assert child.stderr is not None
            assert b"a station is heard" in child.stderr.readline()
            yield
            if "--count" not in options:
                child.send_signal(signal.SIGTERM)
            assert child.wait(PATIENCE) == 0
        finally:
            child.kill()


def addresses(station: Station) -> list[str]:
    """Return the options by which a command reaches a station."""
    ports = station.ports
    words = ["--station", f"127.0.0.1:{ports['from_users']}"]
    return words + [
        word for name in ("to_users", "pull", "report") for word in (f"--{name.replace('_', '-')}", str(ports[name]))
    ]


def until_there(path: Path, count: int) -> None:
    end = time.monotonic() + PATIENCE
    while (found := sum(one.direction is Direction.IN for one in frames(path))) < count:
        assert time.monotonic() < end, f"{found} frames of {count}"
        time.sleep(BETWEEN)


def frames(path: Path) -> list[capture.Frame]:
    """Return the frames of a file, or of a folder in the order of its files. A half-written last block is skipped."""
    found: list[capture.Frame] = []
    for one in captures(path):
        with one.open("rb") as stream:
            try:
                found += capture.frames(stream.read(4), stream)
            except ProtocolError:
                continue
    return found


def captures(path: Path) -> list[Path]:
    return sorted(path.iterdir(), key=lambda one: one.name.partition("-")[2]) if path.is_dir() else [path]


def tshark_says(path: Path) -> list[tuple[str, str, str, int]]:
    """Return for each frame: interface, comment, malformed protocol, and the highest severity that tshark reports."""
    command = ["tshark", "-n", "-r", str(path), "-T", "fields", "-E", "aggregator=|"]
    command += [
        f"-e{name}" for name in ("frame.interface_name", "frame.comment", "_ws.malformed", "_ws.expert.severity")
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=4 * PATIENCE)
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    return [
        (interface, comment, malformed, max(map(int, worst.split("|"))))
        for interface, comment, malformed, worst in rows
    ]


def tshark_opens(path: Path, made_up: Iterable[str]) -> None:
    """Check that tshark opens every frame of a recording without an error and shows the comment of captain."""
    for one in captures(path):
        written = frames(one)
        told = tshark_says(one)
        assert [row[:2] for row in told] == [(frame.interface, frame.comment) for frame in written]
        assert all(frame.comment for frame in written)
        assert {row[2] for row in told} <= {""}
        assert max(row[3] for row in told) <= WORST
        assert {frame.interface for frame in written if frame.said["is_made_up"]} <= set(made_up)


def replay(*words: str) -> dict[str, Any]:
    done = subprocess.run(
        [*PROGRAM, "replay", "--json", "--rate", "1000", *words], capture_output=True, timeout=4 * PATIENCE, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    told: dict[str, Any] = json.loads(done.stdout)
    return told


def facts(one: Received) -> dict[str, Any]:
    """Return all facts of a received message except its time of reception."""
    return {key: value for key, value in one.fields.items() if key not in NOT_OF_THE_MESSAGE}


def are_the_same(found: Sequence[Received], expected: Sequence[Received]) -> None:
    """Check that two sequences of received messages are equal, with all their facts."""
    assert indicated(found) == indicated(expected)
    assert sorted(map(str, map(facts, found))) == sorted(map(str, map(facts, expected)))


def indicated(received: Iterable[Received]) -> list[tuple[bytes, bytes]]:
    """Return envelopes and PDUs, sorted: each type has its own queue, so the order of two types may change."""
    return sorted(((one.envelope, one.pdu) for one in received), key=lambda pair: pair[0])


def endpoint_gives(link: Link, received: Iterable[Received]) -> None:
    """Check that messages replayed into an endpoint leave by a link unchanged, if they are short enough for it."""
    pdus = sorted((one.pdu for one in received if len(one.pdu) <= link.longest), key=lambda pdu: pdu[1])
    assert sorted((link.hear() for _ in pdus), key=lambda pdu: pdu[1]) == pdus
