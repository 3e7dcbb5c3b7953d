"""The lab test, recorded by captain record, and read by mcap-ros2-support as Foxglove's own library reads it."""

import json
import subprocess
import sys
from collections import Counter
from contextlib import suppress
from typing import IO

import zmq

from asn1.backends.ros2.model import RosPackage
from firmware.commands.lab import Test
from firmware.lab.copies import Count
from firmware.lab.laboratory import Seat, bench, vectors
from tests.proof.ros2 import codec, ros
from tests.proof.ros2.rows import Row

TURNS, PERIOD_S = 50, 0.1  # of the ten messages
FILE = ros.MADE / "lab.mcap"
HEARD = "a station is heard"  # what the recorder says when its subscription has come to the station
END_S = 10.0  # until it has read what was sent, and closed its file


def read(packages: list[RosPackage]) -> list[Row]:
    """Rows: what was recorded, and what was read of it; CDR is compared for the editions of the packages."""
    FILE.unlink(missing_ok=True)
    sent = Counter(vector.type for vector in vectors() for _ in range(1 if vector.is_beside else TURNS))
    with bench("udp", 0.0, None) as made:
        recorder = _recorder(made.seats[1], sent.total())
        try:
            _wait(recorder)
            count = Count(vectors(), [seat.name for seat in made.seats])
            Test(made, count, None).run(TURNS, PERIOD_S)
            with suppress(subprocess.TimeoutExpired):  # then it has less than there is
                recorder.wait(END_S)
        finally:
            recorder.terminate()
            recorder.wait(END_S)
    said = "".join(_said(recorder).read().splitlines()[-1:])
    found = json.loads(ros.inside("recording.py", codec.made(packages), FILE))
    return [
        Row("captain record", said, "" if recorder.returncode == 0 else f"exit status {recorder.returncode}"),
        _row("typed messages decoded", found["typed"], sent),
        _row("metadata decoded, with the octets that were sent", found["octets"], sent),
        Row(
            "CDR as compiled code writes it",
            f"{found['same']} of {found['compared']}",
            _less(found["same"], found["compared"]) or ("" if found["compared"] else "none was of these packages"),
        ),
        Row("hashes in the file", f"{found['hashes']} of {len(sent)}", _less(found["hashes"], len(sent))),
    ]


def _recorder(seat: Seat, count: int) -> "subprocess.Popen[str]":
    """captain record at a seat's station, until so many messages have come."""
    port = seat.subscriber.get_string(zmq.LAST_ENDPOINT).rpartition(":")[2].rstrip("/\0")
    command = [sys.executable, "-m", "firmware", "record", "--mcap", FILE, "--to-users", port, "--count", str(count)]
    return subprocess.Popen(command, cwd=ros.ROOT, stderr=subprocess.PIPE, text=True)


def _wait(recorder: "subprocess.Popen[str]") -> None:
    """Until it hears the station. Raises RosError with what it said where it has ended before."""
    lines = []
    for line in _said(recorder):
        if HEARD in line:
            return
        lines.append(line)
    raise ros.RosError(f"captain record heard nobody: {''.join(lines)}")


def _said(recorder: "subprocess.Popen[str]") -> IO[str]:
    assert recorder.stderr is not None
    return recorder.stderr


def _row(what: str, found: dict[str, int], sent: Counter[str]) -> Row:
    """found: by topic; that of an edition which is not the preferred one is called cpm_tr_2_1_1."""
    types: Counter[str] = Counter()
    for topic, count in found.items():
        types[topic.partition("_")[0]] += count
    words = ", ".join(f"{count} {name}" for name, count in sorted(found.items()))
    return Row(what, words, "" if types == sent else f"sent were {dict(sent)}")


def _less(found: int, wanted: int) -> str:
    return "" if found == wanted else f"{wanted - found} less"
