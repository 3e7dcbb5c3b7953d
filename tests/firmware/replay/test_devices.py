"""Frames replayed by a network device, and a lossy link between two: on virtual cables, in a network namespace."""

import json
import subprocess
import sys
from pathlib import Path

from drivers.wire.impairment import Impairment, Impairments
from firmware.lab.laboratory import vectors
from firmware.recordings import capture
from tests.firmware.replay.test_rewriting import frame_of

PROGRAM = Path(__file__).with_name("devices_program.py")
LOSS = 0.3


def test_exactly_those_frames_come_out_that_the_seed_does_not_lose(tmp_path):
    frames = [frame_of(one.pdu[:6] + at.to_bytes(2) + one.pdu[8:]) for at in range(5) for one in vectors()]
    way = Impairment[None](Impairments(loss=LOSS))
    for octets in frames:
        way.take(octets, 0.0, None)
    expected = [one.octets.hex() for one in way.due(0.0)]
    path = tmp_path / "drive.pcap"
    path.write_bytes(capture.header() + b"".join(capture.record(one, at) for at, one in enumerate(frames, 1)))
    command = [sys.executable, str(PROGRAM), str(path), str(LOSS), str(len(expected))]
    done = subprocess.run(
        ["unshare", "--map-root-user", "--net", *command], capture_output=True, cwd=PROGRAM.parents[3], check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    told = json.loads(done.stdout)
    there, back = told["ways"]
    assert told["heard"] == expected
    assert told["replay"]["sent"] == there["heard"] == len(frames)
    assert (there["lost"], there["sent"]) == (len(frames) - len(expected), len(expected))
    assert back["heard"] == 0
