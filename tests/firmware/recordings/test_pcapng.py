import io
import json
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.recordings import capture
from firmware.recordings.pcapng import Direction, Pcapng
from tests.firmware.codec.captures import WHEN_NS, block, enhanced, interface, section

# A beacon: basic header, common header, long position vector of zeros (EN 302 636-4-1 clause 9).
BEACON = bytes.fromhex("ffffffffffff02000000000b894711001a010010000200000100") + bytes(24)
SAID = {"sequence": 7, "reason": "duplicate", "quality": {"state": "locked", "error_ns": 120}}


def written(*frames: dict[str, object], **about: object) -> bytes:
    stream = io.BytesIO()
    recording = Pcapng(stream, "captain 1", **about)
    for frame in frames:
        recording.add(**{"interface": "air", "when_ns": WHEN_NS, "frame": BEACON, **frame})
    assert recording.size == len(stream.getvalue())
    return stream.getvalue()


def read(octets: bytes) -> list[capture.Frame]:
    return list(capture.frames(octets[:4], io.BytesIO(octets[4:])))


def tshark(path: Path, *fields: str) -> list[list[str]]:
    command = ["tshark", "-n", "-r", str(path), "-T", "fields", *(f"-e{field}" for field in fields)]
    answer = subprocess.run(command, capture_output=True, check=True, timeout=60, text=True)
    return [line.split("\t") for line in answer.stdout.splitlines()]


def test_what_is_written_of_a_frame_is_read_again():
    octets = written(
        {"direction": Direction.OUT, "comment": "it left", "said": SAID, "lost": 3}, said={"station": "rsu"}
    )
    assert read(octets) == [
        capture.Frame(
            1, 1, WHEN_NS, BEACON, 0, "air", "", Direction.OUT, "it left", 3, SAID, {"station": "rsu"}
        )
    ]  # fmt: skip


def test_an_interface_is_described_once_and_before_its_first_frame():
    stream = io.BytesIO()
    recording = Pcapng(stream, "captain 1")
    recording.interface("air", "its-g5 by som301e")
    for name in ("air", "wire", "air"):
        recording.add(name, WHEN_NS, BEACON)
    found = [(one.interface, one.description) for one in read(stream.getvalue())]
    assert found == [("air", "its-g5 by som301e"), ("wire", ""), ("air", "its-g5 by som301e")]


def test_a_nanosecond_is_kept():
    assert [one.when_ns for one in read(written({"when_ns": WHEN_NS + 1}))] == [WHEN_NS + 1]


def test_a_time_before_1970_is_written_as_1970():
    assert read(written({"when_ns": -1}))[0].when_ns == 0


def test_frames_of_any_length_are_whole_blocks():
    octets = b"".join(
        written({"frame": bytes(length), "comment": "x" * length, "said": {"a": "b" * length}}) for length in range(9)
    )
    assert [len(one.octets) for one in read(octets)] == list(range(9))
    assert [len(one.comment) for one in read(octets)] == list(range(9))


def test_a_recording_that_was_cut_off_is_read_up_to_there():
    octets = written({}, {})
    found = capture.frames(octets[:4], io.BytesIO(octets[4:-1]))
    assert next(found).octets == BEACON
    with pytest.raises(capture.ProtocolError, match="cut off"):
        next(found)


def test_a_comment_that_is_too_long_ends_with_a_whole_character():
    comment = read(written({"comment": "ä" * 40_000 + "b"}))[0].comment
    assert set(comment) == {"ä"}


def test_an_object_that_is_too_long_is_left_out_whole():
    assert read(written({"said": {"detail": "x" * 40_000}}))[0].said == {}


def test_a_text_that_no_encoding_takes_does_not_end_a_recording():
    assert read(written({"comment": "a\udc80b"}))[0].comment == "a?b"


@pytest.mark.parametrize(
    "value",
    [
        struct.pack("<I", 9) + b'captain:{"sequence":1}',  # of another enterprise
        struct.pack("<I", 32473) + b'other:{"sequence":1}',  # anybody may use the number of documentation
        struct.pack("<I", 32473) + b"captain:{",
        struct.pack("<I", 32473) + b"captain:[1]",
        struct.pack("<I", 32473) + b"captain:\xff",
        b"abc",
    ],
)
def test_a_custom_option_of_others_is_not_believed(value):
    option = struct.pack("<HH", 2988, len(value)) + value + bytes(-len(value) % 4) + bytes(4)
    head = struct.pack("<IIIII", 0, 0, 0, 0, 0)
    assert read(section() + interface() + block(6, head + option))[0].said == {}


def test_comments_of_a_foreign_file_are_read_in_its_order_of_octets():
    options = struct.pack(">HH4sHH4sHHI", 1, 4, b"one ", 1, 4, b"two ", 2, 4, 2) + bytes(4)
    head = struct.pack(">IIIII", 0, 0, 0, 0, 0)
    octets = section(">") + interface(order=">") + block(6, head + options, ">")
    (frame,) = read(octets)
    assert (frame.comment, frame.direction) == ("one \ntwo ", Direction.OUT)


@given(st.binary(max_size=60))
def test_random_options_are_taken_or_explained(octets):
    head = struct.pack("<IIIII", 0, 0, 0, 0, 0)
    try:
        read(section() + interface() + block(6, head + octets) + enhanced(b"a", 1))
    except capture.ProtocolError as error:
        assert error.message


def test_tshark_opens_it_and_shows_comments_interfaces_and_directions(tmp_path):
    path = tmp_path / "x.pcapng"
    stream = io.BytesIO()
    recording = Pcapng(stream, "captain 1", "station rsu", {"station": "rsu"})
    recording.interface("air", "its-g5 by som301e")
    recording.add("air", WHEN_NS, BEACON, Direction.IN, "heard: -71 dBm", SAID)
    recording.add("wire", WHEN_NS + 1, BEACON, Direction.OUT, "dropped: duplicate", SAID, lost=2)
    recording.statistics("air", WHEN_NS, 1, 0)
    recording.statistics("wire", WHEN_NS, 1, 2)
    path.write_bytes(stream.getvalue())
    fields = (
        "frame.comment",
        "frame.interface_name",
        "frame.packet_flags_direction",
        "frame.drop_count",
        "_ws.malformed",
    )
    assert tshark(path, "frame.time_epoch", *fields) == [
        ["1795182426.461613000", "heard: -71 dBm", "air", "0x00000001", "", ""],
        ["1795182426.461613001", "dropped: duplicate", "wire", "0x00000002", "2", ""],
    ]
    told = subprocess.run(["capinfos", str(path)], capture_output=True, check=True, timeout=60, text=True).stdout
    for words in ("station rsu", "captain 1", "Name = air", "Description = its-g5 by som301e", "nanoseconds"):
        assert words in told


def test_the_object_of_a_frame_is_json_in_its_option():
    octets = written({"said": SAID})
    assert json.dumps(SAID, separators=(",", ":")).encode() in octets
