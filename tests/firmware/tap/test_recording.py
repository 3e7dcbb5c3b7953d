import json
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError, StationError
from firmware.recordings import capture
from firmware.tap.counts import Taken
from firmware.tap.recording import Recording, Rotation

Record = Callable[..., Recording]
CAM = bytes.fromhex("02020000053900010203")


@pytest.fixture
def record(tmp_path: Path) -> Iterator[Record]:
    """Recordings in tmp_path, by file name and the words of Rotation; closed at the end."""
    with ExitStack() as closing:

        def begin(name: str = "drive.jsonl", **rotation: int) -> Recording:
            recording = Recording(tmp_path / name, Rotation(**rotation))
            closing.callback(recording.close)
            return recording

        yield begin


def taken(number: int = 0, pdu: bytes = CAM, port: int | None = 2001) -> Taken:
    return Taken(pdu, port, "vm", "v2x/btp/2001", 1795182426_000000000 + number * 1000)


def recorded(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_json_lines_have_payload_type_port_topic_source_and_time(tmp_path: Path, record: Record) -> None:
    recording = record()
    recording.write(taken())
    assert recorded(tmp_path / "drive.jsonl") == [
        {
            "type": "cam",
            "station_id": 1337,
            "message_id": 2,
            "protocol_version": 2,
            "octets": 10,
            "received": 1795182426.0,
            "btp_port": 2001,
            "topic": "v2x/btp/2001",
            "source": "vm",
            "hex": CAM.hex(),
        }
    ]


def test_a_pcap_is_read_by_our_own_reader_and_holds_the_message(tmp_path: Path, record: Record) -> None:
    recording = record("drive.pcap")
    recording.write(taken(1))
    recording.close()
    with (tmp_path / "drive.pcap").open("rb") as file:
        (frame,) = capture.frames(file.read(4), file)
    assert frame.when_ns == 1795182426_000001000
    assert frame.octets.endswith(CAM)


def test_what_has_no_port_is_refused_by_pcap_and_the_next_one_written(tmp_path: Path, record: Record) -> None:
    recording = record("drive.pcap")
    with pytest.raises(RequestError):
        recording.write(taken(pdu=bytes((2, 255)) + bytes(8), port=None))
    recording.write(taken())
    assert recording.messages == 1


def test_a_file_that_is_there_is_never_written_over(tmp_path: Path, record: Record) -> None:
    (tmp_path / "drive.jsonl").write_text("precious")
    with pytest.raises(StationError, match="the file exists"):
        record()
    assert (tmp_path / "drive.jsonl").read_text() == "precious"


def test_copies_with_one_name_take_numbers_of_their_own(tmp_path: Path, record: Record) -> None:
    one, two = (record("drive.jsonl", messages=2) for _ in range(2))
    for number in range(3):
        one.write(taken(number))
        two.write(taken(number))
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"drive.00000{at}.jsonl" for at in (1, 2, 3, 4)]


def test_only_the_newest_files_are_kept(tmp_path: Path, record: Record) -> None:
    recording = record("drive.jsonl", messages=1, keep=2)
    for number in range(5):
        recording.write(taken(number))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drive.000004.jsonl", "drive.000005.jsonl"]


@given(sizes=st.lists(st.integers(6, 300), max_size=40), most=st.integers(4096, 6000), count=st.integers(1, 9))
def test_rotation_keeps_every_message_in_order_within_both_limits(sizes: list[int], most: int, count: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        recording = Recording(Path(folder) / "x.jsonl", Rotation(octets=most, messages=count))
        for number, size in enumerate(sizes):
            recording.write(taken(number, pdu=CAM[:6].ljust(size, b"\1")))
        recording.close()
        files = sorted(Path(folder).iterdir())
        parts = [recorded(path) for path in files]
        assert [row["octets"] for part in parts for row in part] == sizes
        assert all(path.stat().st_size <= most and len(part) <= count for path, part in zip(files, parts, strict=True))
        # Another file is begun only when it must be.
        for (path, part), after in pairwise(zip(files, parts, strict=True)):
            longer = path.stat().st_size + len(json.dumps(after[1][0])) + 1
            assert len(part) == count or longer > most


@pytest.mark.parametrize("name", ["drive", "drive.txt", "drive.pcapng"])
def test_a_name_of_no_known_form_is_refused_with_those_that_are(record: Record, name: str) -> None:
    with pytest.raises(RequestError, match="unknown format") as refused:
        record(name)
    assert ".jsonl" in str(refused.value)


def test_a_folder_that_is_not_there_is_told(tmp_path: Path, record: Record) -> None:
    with pytest.raises(StationError, match="No such file"):
        record("no/drive.jsonl", messages=1)


class Card:
    """What is waited for, with the clock of a recording; it may refuse."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.waits: list[str] = []
        self.refusal: OSError | None = None
        patch.setattr(os, "fsync", self._fsync)

    def clock(self) -> float:
        return self.now

    def _fsync(self, descriptor: int) -> None:
        self.waits.append(Path(f"/proc/self/fd/{descriptor}").readlink().name)
        if self.refusal is not None:
            raise self.refusal


def test_no_message_waits_longer_than_half_a_second_for_the_card_and_none_is_waited_for_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = Card(monkeypatch)
    recording = Recording(tmp_path / "drive.jsonl", Rotation(), card.clock)
    for _ in range(100):  # of 20 ms: two seconds
        recording.write(taken())
        card.now += 0.02
    assert card.waits == ["drive.jsonl", tmp_path.name, *["drive.jsonl"] * 2]
    card.now += 0.5  # and nothing more comes
    recording.idle()
    card.now += 10
    recording.idle()
    assert len(card.waits) == 5
    recording.close()
    assert len(card.waits) == 5


def test_a_file_is_on_the_card_before_the_next_one_begins_and_when_it_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = Card(monkeypatch)
    recording = Recording(tmp_path / "drive.jsonl", Rotation(messages=1), card.clock)
    recording.write(taken())
    recording.write(taken())
    assert card.waits == ["drive.000001.jsonl", tmp_path.name]
    recording.close()
    assert card.waits[2:] == ["drive.000002.jsonl", tmp_path.name]


def test_a_card_that_fails_is_told_when_it_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    card = Card(monkeypatch)
    recording = Recording(tmp_path / "drive.jsonl", Rotation(), card.clock)
    recording.write(taken())
    card.now += 1
    card.refusal = OSError(5, "Input/output error")
    with pytest.raises(StationError, match="Input/output error; 1 messages are recorded"):
        recording.idle()
    recording.close()


def test_a_full_disk_says_how_much_was_recorded(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = record()
    recording.write(taken())
    with open("/dev/full", "wb", buffering=0) as full, monkeypatch.context() as patch:
        patch.setattr(recording, "_file", full)
        with pytest.raises(StationError, match="No space left on device; 1 messages are recorded"):
            recording.write(taken())
