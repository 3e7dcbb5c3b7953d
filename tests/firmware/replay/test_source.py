"""Source of a replay: messages of each kind of file."""

import io
import json
from pathlib import Path

import pytest

from board.runtime.errors import RequestError
from drivers.wire import frame as ethernet
from firmware.codec.reading import Pdu
from firmware.lab.laboratory import vectors
from firmware.recordings import capture
from firmware.recordings.pcapng import Direction, Pcapng
from firmware.replay.source import Choice, Source
from tests.firmware.replay.test_rewriting import frame_of

PDUS = [one.pdu for one in vectors()]
FRAMES = [frame_of(pdu) for pdu in PDUS]
BEACON = ethernet.wrap(bytes(6), bytes.fromhex("11001a01001080000000 0100".replace(" ", "")) + bytes(24))
BROKEN = ethernet.wrap(bytes(6), b"\x11\0\x1a\1")
OTHER = b"\xff" * 12 + b"\x08\0" + bytes(40)


def source(what: Path | str, choice: Choice | None = None, form: str | None = None, given: bytes = b""):
    one = Source(form, choice or Choice(), io.BytesIO(given))
    items = list(one.items([str(what)]))
    return items, one.skipped


def pcap(path: Path, *frames: bytes) -> Path:
    path.write_bytes(capture.header() + b"".join(capture.record(one, 10**18 + at) for at, one in enumerate(frames)))
    return path


def test_frames_of_a_capture_come_as_they_are_broken_ones_and_beacons_among_them(tmp_path):
    frames = [*FRAMES, BEACON, BROKEN, OTHER]
    items, skipped = source(pcap(tmp_path / "a.pcap", *frames))
    assert all(isinstance(one, Pdu) for one in items)
    assert [one.frame for one in items] == frames[:-1]
    assert [one.octets for one in items] == [*PDUS, b"", b""]
    assert [one.when_ns for one in items] == [10**18 + at for at in range(len(frames) - 1)]
    assert items[-2].carried == "beacons"
    assert items[-1].carried.startswith("broken: ")
    assert skipped == {"frames not GeoNetworking": 1}


def test_the_same_comes_from_a_pipe(tmp_path):
    path = pcap(tmp_path / "a.pcap", *FRAMES)
    piped, _ = source("-", given=path.read_bytes())
    assert [(one.frame, one.octets) for one in piped] == [(one.frame, one.octets) for one in source(path)[0]]


def test_what_a_ring_has_kept_comes_where_it_was_among_the_rest_of_the_ring(tmp_path):
    names = ["ring-00000008-20261123T080000Z", "kept-00000009-20261123T080100Z-denm", "ring-00000010-20261123T080200Z"]
    for at, name in enumerate(names):
        pcap(tmp_path / f"{name}.pcapng", FRAMES[at])
    assert [one.frame for one in source(tmp_path)[0]] == FRAMES[:3]


def test_a_folder_that_is_not_to_be_read_is_told(tmp_path, monkeypatch):
    def iterdir(self: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", iterdir)
    (told,) = source(tmp_path)[0]
    assert isinstance(told, RequestError)
    assert told.message == f"{tmp_path}: Permission denied"


def recording(path: Path) -> Path:
    with path.open("wb") as stream:
        one = Pcapng(stream, "test")
        one.interface("g5", "its-g5 by udp")
        one.interface("5g", "v2n by mqtt")
        one.add("g5", 1, FRAMES[0], Direction.IN)
        one.add("g5", 2, FRAMES[1], Direction.OUT)
        one.add("5g", 3, FRAMES[2], Direction.IN, said={"is_made_up": True})
        one.add("g5", 4, FRAMES[3], Direction.IN, said={"reason": "duplicate", "meaning": "it came twice"})
        one.add("g5", 5, FRAMES[4], Direction.UNKNOWN)
    return path


@pytest.mark.parametrize(
    ("choice", "expected"),
    [
        (Choice(), [0, 2, 3, 4]),
        (Choice("out"), [1, 4]),
        (Choice("both"), [0, 1, 2, 3, 4]),
        (Choice("both", frozenset({"5g"})), [2]),
        (Choice(has_dropped=False), [0, 2, 4]),
    ],
)
def test_of_a_recording_goes_what_is_asked_for_and_the_rest_is_counted(tmp_path, choice, expected):
    items, skipped = source(recording(tmp_path / "a.pcapng"), choice)
    assert [PDUS.index(one.octets) for one in items] == expected
    assert sum(skipped.values()) == 5 - len(expected)


def test_a_frame_of_another_link_layer_gets_an_ethernet_one_with_its_makers_address(tmp_path):
    wlan = b"\x08\0" + bytes(22) + b"\xaa\xaa\x03\0\0\0" + FRAMES[0][12:]
    header = capture.header()[:-4] + (105).to_bytes(4, "little")
    path = tmp_path / "a.pcap"
    path.write_bytes(header + capture.record(wlan, 1))
    (one,), _ = source(path)
    assert one.frame == FRAMES[0]


@pytest.mark.parametrize("form", ["hex", "base64", "json"])
def test_lists_of_messages_have_no_frames(tmp_path, form):
    import base64

    path = tmp_path / "list"
    lines = {
        "hex": [one.hex() for one in PDUS],
        "base64": [base64.b64encode(one).decode() for one in PDUS],
        "json": [json.dumps({"hex": one.hex(), "received": 5.25}) for one in PDUS],
    }
    path.write_text("\n".join(lines[form]))
    items, _ = source(path, form=form)
    assert [(one.octets, one.frame) for one in items] == [(pdu, b"") for pdu in PDUS]
    assert {one.when_ns for one in items} == {5_250_000_000 if form == "json" else None}


def test_decoded_messages_are_encoded(tmp_path, capsys):
    from firmware import cli

    path, told = tmp_path / "cams.hex", tmp_path / "cams.jsonl"
    path.write_text(PDUS[1].hex())
    assert cli.main(["convert", str(path), "-o", str(told)]) == 0
    value = json.loads(told.read_text())
    value.pop("hex", None)
    told.write_text(json.dumps(value))
    (one,), _ = source(told)
    assert one.octets == PDUS[1]


def test_what_is_wrong_is_one_item_and_the_next_is_read(tmp_path):
    path = tmp_path / "a.hex"
    path.write_text(f"{PDUS[0].hex()}\nnonsense\n{PDUS[1].hex()}\n")
    items, _ = source(path)
    assert [isinstance(one, RequestError) for one in items] == [False, True, False]


def test_a_capture_that_is_cut_off_is_played_up_to_there(tmp_path):
    path = pcap(tmp_path / "a.pcap", *FRAMES)
    path.write_bytes(path.read_bytes()[:-5])
    items, _ = source(path)
    assert len(items) == len(FRAMES)
    assert isinstance(items[-1], RequestError)
