import base64
import errno
import io
import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from firmware.codec.reading import FORMS, Item, Object, Pdu, Reader, pdu_of
from tests.firmware.codec.captures import WHEN_NS, pcap, pcapng
from tests.firmware.recordings.test_layers import FRAMES
from tests.said import tells

CAM = bytes.fromhex("02020000053900010203")
FRAME = FRAMES["cam-shb"]
PDU = FRAME[-41:]


def read(*sources: str, form: str | None = None, given_octets: bytes = b"") -> list[Item]:
    return list(Reader(form, io.BytesIO(given_octets)).read(sources))


def only(*sources: str, form: str | None = None, given_octets: bytes = b"") -> Item:
    (item,) = read(*sources, form=form, given_octets=given_octets)
    return item


def octets(*sources: str, form: str | None = None, given_octets: bytes = b"") -> bytes:
    item = only(*sources, form=form, given_octets=given_octets)
    assert isinstance(item, Pdu), item
    return item.octets


def refusal(*sources: str, form: str | None = None, given_octets: bytes = b"") -> str:
    item = only(*sources, form=form, given_octets=given_octets)
    assert isinstance(item, RequestError)
    return item.message


@pytest.mark.parametrize(
    "given_octets",
    [
        CAM.hex().encode(),
        CAM.hex(" ").upper().encode() + b"\r\n",
        b"# a CAM\n\n0x" + CAM.hex().encode() + b" # of nobody\n",
        base64.b64encode(CAM) + b"\n",
        CAM,
    ],
)
def test_standard_input_is_known_by_its_looks(given_octets):
    assert octets("-", given_octets=given_octets) == CAM


@given(st.binary(min_size=6, max_size=300))
def test_hexadecimal_and_base64_give_the_octets_back(pdu):
    pdu = b"\x02" + pdu
    assert octets(pdu.hex()) == pdu
    assert octets(base64.b64encode(pdu).decode(), form="base64") == pdu
    assert octets("-", given_octets=pdu) == pdu


def test_octets_of_an_argument_may_stand_apart():
    assert octets(*CAM.hex(" ").split()) == CAM


@pytest.mark.parametrize("make", [pcap, pcapng])
@pytest.mark.parametrize("name", ["x.pcap", "noname", "x.txt"])
def test_a_capture_is_known_by_its_first_octets_whatever_its_name(tmp_path, make, name):
    (tmp_path / name).write_bytes(make([FRAME]))
    item = only(str(tmp_path / name))
    where = f"{tmp_path / name}: frame 1"
    assert item == Pdu(PDU, where, 2001, WHEN_NS // 1000 * 1000, "shb, BTP port 2001", FRAME)


def test_a_capture_may_come_through_a_pipe():
    assert octets("-", given_octets=pcap([FRAME])) == PDU


def test_frames_without_a_message_are_counted_and_broken_ones_are_told():
    reader = Reader(None, io.BytesIO(pcap([bytes(60), FRAME, FRAME[:70], bytes(60)])))
    pdu, error = reader.read(["-"])
    assert isinstance(pdu, Pdu)
    assert str(error) == "standard input: frame 3: GeoNetworking: 16 of 45 payload octets"
    assert reader.skipped == {"not GeoNetworking": 2}


def test_capture_that_is_cut_off_is_read_up_to_its_end():
    pdu, error = read("-", given_octets=pcap([FRAME, FRAME])[:-1])
    assert isinstance(pdu, Pdu)
    assert tells(str(error), "cut off", "frame 2")


@pytest.mark.parametrize("name", ["cam-shb", "cam-signed-digest"])
def test_a_whole_frame_may_stand_in_place_of_its_message(name):
    item = only(FRAMES[name].hex())
    assert isinstance(item, Pdu)
    assert (item.port, len(item.octets), item.frame) == (2001, 41, FRAMES[name])


def test_a_frame_that_is_broken_is_refused():
    assert "GeoNetworking: 16 of 45 payload octets" in refusal(FRAME[:70].hex())


def test_a_line_that_is_wrong_does_not_stop_the_next():
    items = read("-", given_octets=b"0202zz\n" + CAM.hex().encode() + b"\n020\n")
    assert [type(item) for item in items] == [RequestError, Pdu, RequestError]
    assert "standard input: line 1: character 5, 'z', is not a hexadecimal digit" in str(items[0])
    assert "standard input: line 3: 3 hexadecimal digits" in str(items[2])


def test_json_objects_between_lines_of_another_form_are_read_as_they_are():
    text = b'{"hex": "0202"}\n' + CAM.hex().encode() + b'\n{\n "message": {}\n}\n[{"a": 1}, 7]\n'
    items = read("-", given_octets=text)
    assert items[0] == Object({"hex": "0202"}, "standard input: line 1")
    assert isinstance(items[1], Pdu)
    assert items[2] == Object({"message": {}}, "standard input: line 3")
    assert items[3] == Object({"a": 1}, "standard input: line 6: item 0")
    assert tells(str(items[4]), "line 6: item 1: ", "'7'", "not an object")


def test_an_object_may_be_an_argument():
    assert only('{"edition": "cam-1.4.1"}') == Object({"edition": "cam-1.4.1"}, "the argument")


def test_what_listen_prints_has_octets_and_a_time():
    line = json.dumps({"type": "cam", "received": 1795182426.461613, "hex": CAM.hex()})
    item = only(line)
    assert isinstance(item, Object)
    assert pdu_of(item) == Pdu(CAM, "the argument", None, WHEN_NS)


@pytest.mark.parametrize("value", [{}, {"hex": 5}, {"hex": "0"}, {"hex": "zz"}, {"base64": "*"}])
def test_an_object_without_octets_is_refused(value):
    with pytest.raises(RequestError, match="here: "):
        pdu_of(Object(value, "here"))


@pytest.mark.parametrize("value", [-1, True, "2001", 70000, 2.5, None])
def test_a_port_or_time_that_cannot_be_is_none(value):
    found = pdu_of(Object({"hex": "0202", "btp_port": value, "received": str(value)}, "here"))
    assert (found.port, found.when_ns) == (None, None)


def test_the_files_of_a_folder_are_read_in_their_order(tmp_path):
    (tmp_path / "b.bin").write_bytes(CAM)
    (tmp_path / "a.hex").write_text(CAM.hex())
    (tmp_path / "c").mkdir()
    origins = [item.origin for item in read(str(tmp_path)) if isinstance(item, Pdu)]
    assert origins == [f"{tmp_path}/a.hex: line 1", f"{tmp_path}/b.bin"]


@pytest.mark.parametrize("name", ["cam.hex", "no/such/file", "drive.pcapng", "x.jsonl"])
def test_file_that_is_absent_is_refused_by_its_name(name):
    assert refusal(name) == f"{name}: {os.strerror(errno.ENOENT)}"


def test_base64_with_a_slash_is_no_file():
    pdu = bytes.fromhex("0202ffffff00")
    assert "/" in base64.b64encode(pdu).decode()
    assert octets(base64.b64encode(pdu).decode()) == pdu


@pytest.mark.parametrize("form", ["binary", "pcap"])
def test_argument_in_a_form_of_octets_is_refused(form):
    assert tells(refusal("0202", form=form), "argument", form)


@pytest.mark.parametrize("given_octets", [b"", b"\n\n", b"# nothing\n"])
def test_input_without_a_message_is_refused(given_octets):
    assert tells(refusal("-", given_octets=given_octets), "standard input: ", "no message")


def test_captures_without_a_frame_are_refused_unless_another_has_one(tmp_path):
    assert tells(refusal("-", given_octets=pcap([])), "standard input: ", "no frame")
    for name, frames in (("a", []), ("b", [])):
        (tmp_path / name).write_bytes(pcap(frames))
    assert tells(refusal(str(tmp_path / "a"), str(tmp_path / "b")), f"{tmp_path / 'a'}, {tmp_path / 'b'}: ", "no frame")
    (tmp_path / "b").write_bytes(pcap([FRAME]))
    assert octets(str(tmp_path)) == PDU


def test_more_octets_than_a_message_can_have_are_refused():
    assert "more than 65535 octets: too long for a PDU" in refusal("-", given_octets=bytes(70_000))


@given(st.binary(max_size=80), st.sampled_from([None, *FORMS]))
def test_no_standard_input_is_more_than_refused(given_octets, form):
    for item in read("-", form=form, given_octets=given_octets):
        assert isinstance(item, Pdu | Object) or item.message.startswith("standard input")


@given(st.text(max_size=40), st.sampled_from([None, *FORMS]))
def test_no_argument_is_more_than_refused(text, form):
    if text != "-":
        for item in read(text, form=form):
            assert isinstance(item, Pdu | Object | RequestError)
