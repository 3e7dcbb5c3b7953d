"""The lab test, recorded by captain record, and read by mcap-ros2-support as Foxglove's own library reads it."""

import json
import subprocess
import sys
import time
from collections import Counter

import zmq

from asn1.ros2.model import RosPackage
from firmware.commands.lab import Test
from firmware.lab.copies import Count
from firmware.lab.laboratory import Seat, bench, vectors
from tests.ros2 import codec, ros
from tests.ros2.rows import Row

TURNS, PERIOD_S = 50, 0.1  # of the ten messages
FILE = ros.MADE / "lab.mcap"
JOIN_S = 2.0  # until the recorder's subscription has come to the station
END_S = 30.0


def read(packages: list[RosPackage]) -> list[Row]:
    """Rows: what was recorded, and what was read of it; CDR is compared for the editions of the packages."""
    FILE.unlink(missing_ok=True)
    with bench("udp", 0.0, None) as made:
        recorder = _recorder(made.seats[1])
        try:
            time.sleep(JOIN_S)
            count = Count(vectors(), [seat.name for seat in made.seats])
            Test(made, count, None).run(TURNS, PERIOD_S)
        finally:
            recorder.terminate()
            said = recorder.communicate(timeout=END_S)[1]
    sent = Counter(vector.type for vector in vectors() for _ in range(1 if vector.is_beside else TURNS))
    found = json.loads(ros.inside("recording.py", codec.made(packages), FILE))
    return [
        Row("captain record", said.strip(), "" if recorder.returncode == 0 else f"exit status {recorder.returncode}"),
        _row("typed messages decoded", found["typed"], sent),
        _row("metadata decoded, with the octets that were sent", found["octets"], sent),
        Row(
            "CDR as compiled code writes it",
            f"{found['same']} of {found['compared']}",
            _less(found["same"], found["compared"]) or ("" if found["compared"] else "none was of these packages"),
        ),
        Row("hashes in the file", f"{found['hashes']} of {len(sent)}", _less(found["hashes"], len(sent))),
    ]


def _recorder(seat: Seat) -> "subprocess.Popen[str]":
    """captain record at a seat's station."""
    port = seat.subscriber.get_string(zmq.LAST_ENDPOINT).rpartition(":")[2].rstrip("/\0")
    command = [sys.executable, "-m", "firmware", "record", "--mcap", FILE, "--to-users", port]
    return subprocess.Popen(command, cwd=ros.ROOT, stderr=subprocess.PIPE, text=True)


def _row(what: str, found: dict[str, int], sent: Counter[str]) -> Row:
    """found: by topic; that of an edition which is not the preferred one is called cpm_tr_2_1_1."""
    types: Counter[str] = Counter()
    for topic, count in found.items():
        types[topic.partition("_")[0]] += count
    words = ", ".join(f"{count} {name}" for name, count in sorted(found.items()))
    return Row(what, words, "" if types == sent else f"sent were {dict(sent)}")


def _less(found: int, wanted: int) -> str:
    return "" if found == wanted else f"{wanted - found} less"
