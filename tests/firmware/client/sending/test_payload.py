import base64
import errno
import io
import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from firmware.client.sending import payload
from firmware.client.sending.payload import Payload, base64_octets, hex_octets
from tests.said import tells

CAM = bytes.fromhex("020200000539")


def items(*sources: str, form: str | None = None, given_octets: bytes = b"") -> list[payload.Item]:
    return list(payload.read(sources, form, io.BytesIO(given_octets)))


def read(*sources: str, form: str | None = None, given_octets: bytes = b"") -> list[Payload]:
    found = items(*sources, form=form, given_octets=given_octets)
    assert all(isinstance(one, Payload) for one in found), found
    return [one for one in found if isinstance(one, Payload)]


def refusal(*sources: str, form: str | None = None, given_octets: bytes = b"") -> RequestError:
    """The first item that is invalid."""
    found = items(*sources, form=form, given_octets=given_octets)
    return next(one for one in found if isinstance(one, RequestError))


@given(st.binary(min_size=1, max_size=600))
def test_hexadecimal_and_base64_give_the_octets_back(octets):
    assert read(octets.hex())[0].pdu == octets
    assert hex_octets(octets.hex(":"), "") == octets
    assert hex_octets("0x" + octets.hex().upper(), "") == octets
    assert read(base64.b64encode(octets).decode(), form="base64")[0].pdu == octets


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0202 zz", "the argument: character 6, 'z', is not a hexadecimal digit"),
        ("0x02g", "the argument: character 5, 'g', is not a hexadecimal digit"),
        ("020", "3 hexadecimal digits; an octet has two"),
        ("", "it has no octets"),
        ("02 02 0\n", "character 8, '\\n', is not a hexadecimal digit"),
        ("٠٢", "character 1, '٠', is not a hexadecimal digit"),
    ],
)
def test_wrong_hexadecimal_is_refused_with_its_place(text, words):
    assert words in refusal(text).message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("AgI*AAU5", "character 4, '*', is not a base64 character"),
        ("AgIAAAU", "7 characters: invalid length of base64"),
        ("AgIA=AU5", "character 5, '=', is not a base64 character"),
        ("====", "invalid length of base64"),
        ("", "it has no octets"),
    ],
)
def test_wrong_base64_is_refused_with_its_place(text, words):
    assert words in refusal(text, form="base64").message


@given(st.text(max_size=30))
def test_no_text_of_a_user_is_more_than_refused(text):
    for decode in (hex_octets, base64_octets):
        try:
            assert isinstance(decode(text, "here"), bytes)
        except RequestError as error:
            assert error.message.startswith("here: ")


@given(st.binary(max_size=60), st.sampled_from([None, *payload.FORMATS]))
def test_no_standard_input_is_more_than_refused(octets, form):
    for one in items("-", form=form, given_octets=octets):
        assert one.pdu if isinstance(one, Payload) else one.message.startswith("standard input")


def test_each_kind_of_file_is_known_by_its_name(tmp_path):
    (tmp_path / "a.hex").write_text("# two of them\n02 02 00 00 05 39\n\n020200000539 # the second\n")
    (tmp_path / "b.b64").write_text(base64.b64encode(CAM).decode() + "\n")
    (tmp_path / "c.bin").write_bytes(CAM)
    (tmp_path / "d.json").write_text(json.dumps([{"type": "CAM", "hex": CAM.hex()}]))
    (tmp_path / "e.jsonl").write_text('{"base64": "AgIAAAU5", "type": "cam"}\n{"hex": "020200000539"}\n')
    (tmp_path / "README.md").write_text("not a PDU")
    found = read(str(tmp_path))
    assert {one.pdu for one in found} == {CAM}
    assert [one.type for one in found] == ["", "", "", "", "cam", "cam", ""]
    assert [one.origin.removeprefix(str(tmp_path) + "/") for one in found] == [
        "a.hex: line 2",
        "a.hex: line 4",
        "b.b64: line 1",
        "c.bin",
        "d.json: line 1: item 0",
        "e.jsonl: line 1",
        "e.jsonl: line 2",
    ]


def test_the_messages_that_come_with_the_program_can_be_sent():
    import firmware

    found = read(f"{firmware.__path__[0]}/vectors.json")
    assert len(found) == 12
    assert found[0].type == "denm"


def test_standard_input_is_hexadecimal_or_json_lines():
    assert read("-", given_octets=b"\n020200000539\n")[0].pdu == CAM
    lines = b'{"type": "cam", "hex": "020200000539"}\n{"type": "", "hex": "020200000539"}\n'
    assert [one.type for one in read("-", given_octets=lines)] == ["cam", ""]


def test_standard_input_is_read_while_it_comes():
    class Endless(io.BytesIO):
        def readline(self, size: int | None = -1) -> bytes:
            return b'{"hex": "020200000539"}\n'

        __next__ = readline

    found = payload.read(["-"], None, Endless())
    assert [next(found).pdu for _ in range(3)] == [CAM] * 3


def test_octets_of_standard_input_are_one_pdu():
    assert read("-", form="binary", given_octets=CAM)[0].pdu == CAM


@pytest.mark.parametrize(
    ("name", "octets", "words"),
    [
        ("x.pcap", b"\xd4\xc3\xb2\xa1", ".pcap is not a known kind of file"),
        ("noname", b"0202", "a name without a suffix is not a known kind of file"),
        ("x.hex", b"02\xff", "line 1: octet 3: invalid UTF-8 in a hex file"),
        ("x.hex", b"# nothing\n", "it holds no PDU"),
        ("x.bin", b"", "it has no octets"),
        ("x.bin", bytes(70_000), "more than 65535 octets: too long for a PDU"),
        ("x.json", b"", "it holds no PDU"),
        ("x.json", b"[1]", "item 0: '1' is not an object"),
        ("x.json", b'[{"hex": "0"}]', "item 0: hex: 1 hexadecimal digits"),
        ("x.json", b'[{"hex": 7}]', "item 0: `message`, `fields`, `hex` or `base64` is missing"),
        ("x.json", b'[{"hex": "02", "type": "a.b"}]', "item 0: type 'a.b' is not a name of a type"),
        ("x.json", b"[{", "it is not JSON: Expecting property name enclosed in double quotes at line 1, character 3"),
        ("x.jsonl", b'{"hex": "02"}\n{"hex"}\n', "line 2: it is not JSON"),
        ("x.json", b"[" * 100_000, "it is not JSON"),
    ],
)
def test_a_file_that_is_not_what_it_is_called_is_refused_with_the_place(tmp_path, name, octets, words):
    path = tmp_path / name
    path.write_bytes(octets)
    refused = refusal(str(path))
    assert refused.message.startswith(str(path))
    assert words in refused.message


def test_an_unknown_kind_of_file_is_told_what_is_accepted(tmp_path):
    (tmp_path / "x.pcap").write_bytes(b"")
    assert ".hex and .txt (hexadecimal, one PDU per line)" in refusal(str(tmp_path / "x.pcap")).hint
    assert "--format" in refusal(str(tmp_path)).hint


def test_a_file_that_is_not_there_is_not_taken_for_hexadecimal():
    assert "No such file" in refusal("vectors/cam.hex").message
    assert "No such file" in refusal("cam.hex").message


@pytest.mark.parametrize("name", ["drive.pcapng", "./drive", "drives/cam", "cam", "drive", "a b.hex", "AgIAAAU5"])
def test_file_of_any_name_that_is_absent_is_refused(name):
    refused = refusal(name)
    assert refused.message == f"{name.removeprefix('./')}: {os.strerror(errno.ENOENT)}"
    assert refused.hint == payload.NAME_ONE


@pytest.mark.parametrize("form", ["hex", "base64", "binary", "json"])
def test_capture_that_is_absent_is_refused_with_any_format(form):
    assert refusal("drive.pcapng", form=form).message == f"drive.pcapng: {os.strerror(errno.ENOENT)}"


def test_hexadecimal_that_begins_with_a_letter_is_no_name():
    assert read("ab: cd")[0].pdu == b"\xab\xcd"


def test_a_pdu_longer_than_a_file_name_may_be_is_still_hexadecimal():
    assert len(read("02" * 3000)[0].pdu) == 3000


def test_argument_in_a_form_of_octets_is_refused():
    assert tells(refusal("0202", form="binary").message, "argument", "binary")


def test_an_invalid_line_of_27_leaves_the_26_others_and_names_its_line(tmp_path):
    path = tmp_path / "27.hex"
    path.write_text("\n".join([*[CAM.hex()] * 12, "02zz", *[CAM.hex()] * 14]))
    found = items(str(path))
    assert [one.pdu for one in found if isinstance(one, Payload)] == [CAM] * 26
    (refused,) = [one for one in found if isinstance(one, RequestError)]
    assert refused.message == f"{path}: line 13: character 3, 'z', is not a hexadecimal digit"


@pytest.mark.parametrize(
    ("name", "octets", "places"),
    [
        ("x.b64", b"AgIAAAU5\nAg*\nAgIAAAU5\n", ["line 2"]),
        ("x.hex", b"020200000539\n\xff\n020200000539\n", ["line 2"]),
        ("x.json", b'[{"hex": "020200000539"}, 7, {"hex": "0"}, {"hex": "020200000539"}]', ["item 1", "item 2"]),
        ("x.jsonl", b'{"hex": "020200000539"}\n{"hex"}\nno\n{"hex": "020200000539"}\n', ["line 2", "line 3"]),
        ("x.jsonl", b'{"hex"}\n{"hex": "020200000539"}\n{"hex": "020200000539"}\n', ["line 1"]),
    ],
)
def test_an_invalid_item_of_each_form_leaves_the_others(tmp_path, name, octets, places):
    (tmp_path / name).write_bytes(octets)
    found = items(str(tmp_path / name))
    assert [one.pdu for one in found if isinstance(one, Payload)] == [CAM] * 2
    refused = [one.message for one in found if isinstance(one, RequestError)]
    assert [place in message for place, message in zip(places, refused, strict=True)] == [True] * len(places)


def test_a_source_that_is_absent_leaves_the_others(tmp_path):
    (tmp_path / "x.bin").write_bytes(b"")
    (tmp_path / "y.bin").write_bytes(CAM)
    found = items("absent.hex", str(tmp_path), CAM.hex())
    assert [type(one) for one in found] == [RequestError, RequestError, Payload, Payload]


def test_lines_of_standard_input_are_counted_from_its_first():
    assert "line 3: character 1" in refusal("-", given_octets=b"\n\nzz\n").message


def test_json_of_a_message_is_left_to_the_station_without_the_members_of_its_reception():
    text = '{"edition": "cam-1.4.1", "type": "cam", "octets": 46, "message": {"cam": {}}}'
    for found in (read(text), read("-", given_octets=text.encode())):
        ((pdu, kind, _, form),) = found
        assert (json.loads(pdu), kind, form) == ({"edition": "cam-1.4.1", "message": {"cam": {}}}, "cam", "json")


def test_fields_in_place_of_a_message_are_sent_as_json():
    item = {"edition": "cam", "fields": {"speed": 13.9}, "note": "mine"}
    (found,) = payload.read([json.dumps(item)], None, io.BytesIO())
    assert (found.form, json.loads(found.pdu)) == ("json", {"edition": "cam", "fields": {"speed": 13.9}})
