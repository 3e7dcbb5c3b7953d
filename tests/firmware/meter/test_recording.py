"""Measurement of two recordings: one clock, unknown clocks, plain captures."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from board.runtime.errors import StationError
from firmware.endpoint import framing
from firmware.meter import paths, recording
from firmware.meter.fate import Fate, Way
from firmware.meter.meter import Meter
from firmware.recordings import capture
from firmware.recordings.pcapng import Direction, Pcapng

START_NS = 1_795_182_426_000_000_000
GOOD: dict[str, Any] = {"state": "locked", "error_ns": 1000, "offset_ns": 0, "uncertainty_ns": 1000}
UNKNOWN: dict[str, Any] = {"state": "unknown", "error_ns": None, "offset_ns": None, "uncertainty_ns": None}


def frame(number: int, station: int = 1337) -> bytes:
    return framing.of_octets(bytes([2, 2]) + station.to_bytes(4) + number.to_bytes(8))


def recorded(
    path: Path, boot: str, frames: Iterable[tuple[int, float, Direction]], quality: dict[str, Any], ahead_s: float = 0.0
) -> Path:
    """A file as `captain record` writes it: numbers of messages, when, which way."""
    with path.open("wb") as stream:
        writer = Pcapng(stream, "test", said={"boot": boot, "version": "9.9", "configuration": "cafe"})
        writer.interface("g5", "its-g5 by udp")
        for number, at_s, direction in frames:
            said: dict[str, Any] = {"quality": quality}
            if direction is Direction.OUT:
                said |= {"queue_us": 100.0, "send_us": 50.0}
            writer.add("g5", START_NS + round((at_s + ahead_s) * 1e9), frame(number), direction, said=said)
    return path


def measured(one: Path, other: Path) -> tuple[Meter, recording.Laid]:
    meter = Meter()
    laid = recording.measure(meter, recording.read(one, "A", True), recording.read(other, "B", False))
    return meter, laid


WAY = Way("A", "g5", "B", "g5")
LOST = {7, 30, 31}
OUT = [(n, n * 0.1, Direction.OUT) for n in range(50)]
IN = [(n, n * 0.1 + 0.004, Direction.IN) for n in range(50) if n not in LOST]


def test_of_one_clock_loss_and_delay_are_those_that_were_made(tmp_path: Path) -> None:
    meter, laid = measured(
        recorded(tmp_path / "a", "boot", OUT, UNKNOWN), recorded(tmp_path / "b", "boot", IN, UNKNOWN)
    )
    whole = meter.ways[WAY].whole
    assert (whole.sent, whole.lost, whole.counts[Fate.ARRIVED], laid.uncovered) == (50, 3, 47, 0)
    assert whole.one_way_us.quantiles(0.0, 1.0) == [4150.0, 4150.0]  # with what it waited and took to leave
    assert laid.notes == []


@pytest.mark.parametrize("ahead_s", [86_400.0, -3.7])
def test_two_clocks_that_nobody_knows_give_loss_and_no_delay(tmp_path: Path, ahead_s: float) -> None:
    meter, laid = measured(
        recorded(tmp_path / "a", "one", OUT, UNKNOWN), recorded(tmp_path / "b", "other", IN, UNKNOWN, ahead_s)
    )
    whole = meter.ways[WAY].whole
    assert (whole.sent, whole.lost, whole.one_way_us.count) == (50, 3, 0)
    assert f"{ahead_s + 0.004:+.6f} s" in laid.notes[0]


def test_two_clocks_that_are_known_give_delays(tmp_path: Path) -> None:
    meter, _ = measured(recorded(tmp_path / "a", "one", OUT, GOOD), recorded(tmp_path / "b", "other", IN, GOOD))
    whole = meter.ways[WAY].whole
    assert whole.link_us.quantiles(0.5) == [4025.0]
    assert whole.doubt_us.quantiles(0.5) == [37.0]  # half of 50 us to leave, 1 us of each clock, 10 us to read them


def test_what_was_sent_while_the_other_end_was_not_recorded_is_not_counted(tmp_path: Path) -> None:
    late = [one for one in IN if one[1] > 2.0]
    meter, laid = measured(recorded(tmp_path / "a", "boot", OUT, GOOD), recorded(tmp_path / "b", "boot", late, GOOD))
    assert (meter.ways[WAY].whole.sent, meter.ways[WAY].whole.lost, laid.uncovered) == (30, 2, 20)
    assert "20 messages are not counted" in laid.notes[0]


def test_what_was_received_while_the_sender_was_not_recorded_is_no_duplicate(tmp_path: Path) -> None:
    """The same octets again and again: of 50 receptions 20 are of the time in which both were recorded."""
    out = [(1, n * 0.1, Direction.OUT) for n in range(15, 35)]
    into = [(1, n * 0.1 + 0.004, Direction.IN) for n in range(50)]
    meter, _ = measured(recorded(tmp_path / "a", "boot", out, GOOD), recorded(tmp_path / "b", "boot", into, GOOD))
    assert +meter.ways[WAY].whole.counts == {Fate.ARRIVED: 20, Fate.STRANGE: 30}


def test_frames_that_the_recorder_did_not_have_are_no_loss(tmp_path: Path) -> None:
    path = tmp_path / "b"
    with path.open("wb") as stream:
        writer = Pcapng(stream, "test", said={"boot": "boot"})
        for n in (0, 1, 5):
            when_ns = START_NS + round((n * 0.1 + 0.004) * 1e9)
            writer.add("g5", when_ns, frame(n), Direction.IN, said={"quality": GOOD}, lost=2 if n == 5 else 0)
    meter, laid = measured(recorded(tmp_path / "a", "boot", OUT[:6], GOOD), path)
    whole = meter.ways[WAY].whole
    # Of the three between, the last one before the end is not covered: two were missed, and one was lost.
    assert (whole.counts[Fate.UNSEEN], whole.lost) == (2, 1)
    assert any("its recorder did not have" in note for note in laid.notes)


def test_a_long_recording_is_judged_on_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is kept of messages by several ways is bounded: none of them may wait for the end of the file."""
    monkeypatch.setattr(paths, "MOST_OPEN", 100)
    files = []
    for name, direction in (("a", Direction.OUT), ("b", Direction.IN)):
        with (tmp_path / name).open("wb") as stream:
            writer = Pcapng(stream, "test", said={"boot": "boot"})
            for n in range(2000):
                for interface in ("g5", "v2n"):
                    when_ns = START_NS + n * 100_000_000 + (4_000_000 if direction is Direction.IN else 0)
                    writer.add(interface, when_ns, frame(n), direction, said={"quality": GOOD})
        files.append(tmp_path / name)
    meter, _ = measured(*files)
    ((_, both),) = meter.paths.both.items()
    assert (both.sent, both.arrived) == (2000, 2000)


CONSTANT_OUT = [(1, n * 0.1, Direction.OUT) for n in range(30)]
CONSTANT_IN = [(1, n * 0.1 + 0.02, Direction.IN) for n in range(30)]


@pytest.mark.parametrize("ahead_s", [100.0, 3.0])
def test_two_unknown_clocks_and_one_pdu_again_and_again_cannot_be_laid_side_by_side(
    tmp_path: Path, ahead_s: float
) -> None:
    with pytest.raises(StationError, match="their clock errors are unknown"):
        measured(
            recorded(tmp_path / "a", "one", CONSTANT_OUT, UNKNOWN),
            recorded(tmp_path / "b", "other", CONSTANT_IN, UNKNOWN, ahead_s),
        )


@pytest.mark.parametrize("ahead_s", [100.0, 3.0])
def test_two_known_clocks_can_whatever_was_sent(tmp_path: Path, ahead_s: float) -> None:
    ahead: dict[str, Any] = GOOD | {"offset_ns": -round(ahead_s * 1e9)}
    meter, laid = measured(
        recorded(tmp_path / "a", "one", CONSTANT_OUT, GOOD),
        recorded(tmp_path / "b", "other", CONSTANT_IN, ahead, ahead_s),
    )
    whole = meter.ways[WAY].whole
    assert (whole.sent, whole.arrived, whole.lost, laid.uncovered) == (30, 30, 0, 0)
    assert (whole.link_us.count, whole.repeats) == (0, 30)  # of what flowed before the recording nobody knows


def test_plain_captures_are_taken_as_sent_and_received(tmp_path: Path) -> None:
    for name, frames in (("a", OUT), ("b", IN)):
        octets = b"".join(capture.record(frame(n), START_NS + round(at_s * 1e9)) for n, at_s, _ in frames)
        (tmp_path / name).write_bytes(capture.header() + octets)
    meter, _ = measured(tmp_path / "a", tmp_path / "b")
    (way,) = (way for way, one in meter.ways.items() if one.whole.sent)
    assert (meter.ways[way].whole.sent, meter.ways[way].whole.lost) == (50, 3)
    assert recording.told_of(recording.read(tmp_path / "a", "A", True))["notes"]


def test_frames_of_a_plain_capture_that_are_no_messages_are_told(tmp_path: Path) -> None:
    other = bytes(12) + b"\x08\x06" + bytes(28)
    broken = frame(1)[:40]
    frames = [frame(1), other, broken, broken]
    plain = tmp_path / "a"
    plain.write_bytes(capture.header() + b"".join(capture.record(one, START_NS) for one in frames))
    notes = str(recording.told_of(recording.read(plain, "A", True))["notes"])
    assert "1 frames not GeoNetworking" in notes
    assert "2 frames that are broken" in notes
    unknown = bytearray(plain.read_bytes())
    unknown[20] = 220  # LINKTYPE_USB_LINUX_MMAPPED
    plain.write_bytes(unknown)
    assert "4 frames with unsupported link type 220" in str(
        recording.told_of(recording.read(plain, "A", True))["notes"]
    )


def test_a_recording_that_a_cut_of_the_power_ended_is_measured_as_far_as_it_goes(tmp_path: Path) -> None:
    one, other = recorded(tmp_path / "a", "one", OUT, GOOD), recorded(tmp_path / "b", "other", IN, GOOD)
    other.write_bytes(other.read_bytes()[:-7])
    meter, _ = measured(one, other)
    assert meter.ways[WAY].whole.arrived == len(IN) - 1
    (note,) = recording.told_of(recording.read(other, "B", False))["notes"]  # type: ignore[misc]
    assert note.startswith("it is cut off in the block after frame 46: ")


def test_a_recording_with_a_wrong_length_in_it_is_measured_up_to_there_and_it_is_told(tmp_path: Path) -> None:
    one, other = recorded(tmp_path / "a", "boot", OUT, GOOD), recorded(tmp_path / "b", "boot", IN, GOOD)
    octets = bytearray(other.read_bytes())
    at = octets.index(frame(20)) - 24  # of the block's total length
    octets[at : at + 4] = b"\x07\0\0\0"
    other.write_bytes(octets)
    meter, _ = measured(one, other)
    assert meter.ways[WAY].whole.arrived == 19
    (note,) = recording.told_of(recording.read(other, "B", False))["notes"]  # type: ignore[misc]
    assert "only frames before this fault are measured" in note
    assert "cut off" not in note


def test_two_recordings_of_one_station_are_refused(tmp_path: Path) -> None:
    one = recorded(tmp_path / "a", "boot", OUT, GOOD)
    with pytest.raises(StationError, match="are of the same station"):
        measured(one, one)
    for name in "ab":
        with (tmp_path / name).open("wb") as stream:
            Pcapng(stream, "test", said={"boot": "boot", "pid": 7}).add("g5", START_NS, frame(1), Direction.OUT)
    with pytest.raises(StationError, match="are of the same station"):
        measured(tmp_path / "a", tmp_path / "b")


def test_interfaces_of_which_nobody_knows_that_they_hear_each_other_are_told(tmp_path: Path) -> None:
    plain = tmp_path / "b"
    plain.write_bytes(capture.header() + b"".join(capture.record(frame(n), START_NS + n) for n in range(3)))
    with pytest.raises(StationError, match=r"\(g5\) is known to hear one of .*\(capture\)"):
        measured(recorded(tmp_path / "a", "boot", OUT, GOOD), plain)


@pytest.mark.parametrize("octets", [b"", b"no capture", b"\x0a\x0d\x0d\x0a\x1c"])
def test_what_is_no_recording_is_refused_with_its_name(tmp_path: Path, octets: bytes) -> None:
    path = tmp_path / "x"
    path.write_bytes(octets)
    with pytest.raises(StationError, match=str(path)):
        recording.read(path, "A", True)


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(StationError, match="No such file"):
        recording.read(tmp_path / "nowhere", "A", True)
