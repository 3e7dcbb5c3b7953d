"""Frames into pcapng: whose they are, what is missing, and the words about them."""

import io
import subprocess

import pytest

from firmware.recorder.reported_frame import comment_of, parse
from firmware.recorder.scribe import Scribe
from firmware.recordings import capture
from firmware.recordings.pcapng import Direction
from tests.firmware.recorder.reported_frames import FRAME, NOW_NS, message, told
from tests.said import tells

STATUS = {
    "station": "rsu",
    "version": "9",
    "boot": "b",
    "pid": 1,
    "uptime_s": 3.0,
    "interfaces": {"air": {"technology": "its-g5", "driver": "som301e"}},
}


def written(scribe: Scribe, *frames: object) -> list[capture.Frame]:
    scribe.begin(stream := io.BytesIO())
    for one in frames:
        scribe.add(one)
    scribe.end()
    octets = stream.getvalue()
    return list(capture.frames(octets[:4], io.BytesIO(octets[4:])))


def test_a_frame_says_all_that_was_told_of_it():
    scribe = Scribe()
    scribe.take_status(STATUS)
    (frame,) = written(scribe, told(rssi_dbm=-71, direction="out"))
    assert (frame.octets, frame.when_ns, frame.direction) == (FRAME, NOW_NS, Direction.OUT)
    assert (frame.interface, frame.description) == ("air", "its-g5 by som301e")
    assert frame.recording == {"station": "rsu", "version": "9", "boot": "b", "pid": 1}
    assert frame.said["sequence"] == 1
    assert not {"interface", "direction", "when_ns"} & frame.said.keys()


def test_frame_after_a_gap_in_the_numbers_has_the_count_of_missing_ones():
    scribe = Scribe()
    frames = written(scribe, told(5), told(6), told(9), told(10, missed=4), told(3, "wire"))
    assert [frame.lost for frame in frames] == [0, 0, 2, 4, 0]
    assert tells(frames[2].comment, "2 frames", "missing; ")
    assert (scribe.frames, scribe.lost) == (5, 6)


def test_frames_that_nobody_wants_are_not_missing():
    scribe = Scribe()
    scribe.begin(io.BytesIO())
    scribe.add(told(1))
    scribe.pass_over(told(2))
    scribe.add(told(3))
    assert scribe.lost == 0


def test_without_a_stream_frames_are_lost_and_the_next_one_says_so():
    scribe = Scribe()
    scribe.add(told(1))
    scribe.add(told(2))
    (frame,) = written(scribe, told(3))
    assert (frame.lost, scribe.lost, scribe.missing) == (2, 2, 0)


def test_what_did_not_get_into_the_file_is_lost_after_all():
    scribe = Scribe()
    written(scribe, told(1), told(2))
    scribe.unwrite({"air": 2})
    assert (scribe.frames, scribe.lost) == (0, 2)
    assert written(scribe, told(3))[0].lost == 2


def test_an_interface_of_which_all_is_lost_is_told_at_the_end(tmp_path):
    scribe = Scribe()
    scribe.add(told(1, "wire"))
    stream = io.BytesIO()
    scribe.begin(stream)
    scribe.end()
    (tmp_path / "a").write_bytes(stream.getvalue())
    shown = subprocess.run(["capinfos", str(tmp_path / "a")], capture_output=True, text=True, check=True, timeout=60)
    assert "Name = wire" in shown.stdout


def test_another_start_of_the_station_begins_a_section_and_counts_anew():
    scribe = Scribe()
    scribe.take_status(STATUS)
    scribe.begin(stream := io.BytesIO())
    scribe.add(told(900))
    scribe.take_status({**STATUS, "pid": 2})
    scribe.add(told(1))
    scribe.take_status({**STATUS, "pid": 2, "uptime_s": 9.0})
    scribe.add(told(2))
    octets = stream.getvalue()
    frames = list(capture.frames(octets[:4], io.BytesIO(octets[4:])))
    assert [frame.recording["pid"] for frame in frames] == [1, 2, 2]
    assert octets.count(b"\x0a\x0d\x0d\x0a") == 2
    assert scribe.lost == 0


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({}, "cam of station 1337; time locked +-1.2 us"),
        ({"implausible": "time, source"}, "cam of station 1337; implausible: time, source; time locked +-1.2 us"),
        ({"rssi_dbm": -71, "is_made_up": True}, "cam of station 1337; -71 dBm; headers made up; time locked +-1.2 us"),
        (
            {"reason": "duplicate", "meaning": "another one was first", "detail": "g5"},
            "cam of station 1337; dropped: duplicate: another one was first: g5; time locked +-1.2 us",
        ),
        (
            {"direction": "out", "reason": "expired", "meaning": "too old", "queue_us": 5},
            "cam of station 1337; not sent: expired: too old; time locked +-1.2 us",
        ),
        (
            {"direction": "out", "queue_us": 5.5, "send_us": 2, "quality": {"state": "unknown", "error_ns": None}},
            "cam of station 1337; queued for 5.5 us, sent in 2 us; time unknown, accuracy unknown",
        ),
        ({"type": "", "quality": 7}, ""),
    ],
)
def test_a_frame_is_told_in_words(more, words):
    assert comment_of(told(**more)) == words


@pytest.mark.parametrize(
    "frames",
    [
        [b"frame.air.", b"{}"],
        [b"frame.air.", b"{}", b""],
        [b"frame.air.", b"[1]", b""],
        [b"frame.air.", b"\xff", b""],
        *[
            [b"frame.air.", message()[1].replace(b"1795182426461613000", when), b""]
            for when in (b'"x"', b"-1", b"1.5", b"true", b"Infinity", b"1" + bytes(b"0" * 30))
        ],
        [b"frame.air.", message(-1)[1], b""],
        [b"frame.air.", message(missed=-3)[1], b""],
        [b"frame.air.", message(missed=10**30)[1], b""],
        [b"frame.air.", message(station_id=[1])[1], b""],
        [b"frame.air.", message(type={})[1], b""],
    ],
)
def test_what_is_no_frame_is_passed_over(frames):
    assert parse(frames) is None
