"""decode, encode, convert and explain as a user meets them, with a library whose editions differ as a test wants."""

import io
import json

import pytest

from firmware import cli
from tests.firmware.codec.captures import pcap
from tests.firmware.codec.standin import DOOR, NEW, OLD, octets
from tests.said import tells

DOOR_PDU = octets(DOOR, 1, 2, 3)
BALL_PDU = octets(OLD, 7, version=2)
BROKEN = octets(DOOR, 1, 99, 3)


class Captain:
    """Runs a command and keeps what it said."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch = monkeypatch
        self._capsys = capsys
        self.out = self.err = ""

    def __call__(self, *words: str, given: bytes | str = b"") -> int:
        stdin = io.TextIOWrapper(io.BytesIO(given if isinstance(given, bytes) else given.encode()))
        self._monkeypatch.setattr("sys.stdin", stdin)
        code = cli.main(list(words))
        self.out, self.err = self._capsys.readouterr()
        return code

    @property
    def lines(self) -> list[dict[str, object]]:
        return [json.loads(line) for line in self.out.splitlines()]


@pytest.fixture
def captain(monkeypatch, capsys, standin) -> Captain:
    return Captain(monkeypatch, capsys)


# -- decode


def test_decode_shows_what_it_is_why_and_its_fields(captain):
    assert captain("decode", DOOR_PDU.hex()) == 0
    why = captain.out.splitlines()[1].strip()
    assert tells(why, "messageID 67 ", "protocolVersion 2 ", "same octets")
    assert captain.out == (
        "door-1.1: a standard, 9 octets, the argument\n"
        f"  {why}\n"
        "header\n  protocolVersion: 2\n  messageID: 67\n  stationID: 1337\n"
        "body\n  width: 1\n  height: 2\n  depth: 3\n\n"
    )
    assert captain.err == ""


def test_decode_json_is_one_object_a_line_with_all_candidates(captain):
    assert captain("decode", "--json", BALL_PDU.hex()) == 0
    (found,) = captain.lines
    assert found.pop("message") == {
        "header": {"protocolVersion": 2, "messageID": 66, "stationID": 1337},
        "body": {"size": 7},
    }
    assert "as do ball-1.1" in str(found.pop("why"))
    assert found == {
        "edition": "ball-1.2",
        "type": "ball",
        "candidates": ["ball-1.2", "ball-1.1"],
        "origin": "the argument",
        "octets": 7,
    }


def test_decode_of_a_capture_tells_port_and_time(captain, tmp_path):
    (tmp_path / "x.pcap").write_bytes(pcap([bytes(60)]))
    line = json.dumps({"hex": DOOR_PDU.hex(), "btp_port": 3002, "received": 5.25})
    assert captain("convert", line, "-o", str(tmp_path / "y.pcap")) == 0
    assert captain("decode", "--json", str(tmp_path / "y.pcap"), str(tmp_path / "x.pcap")) == 0
    (found,) = captain.lines
    assert (found["btp_port"], found["received"], found["carried"]) == (3002, 5.25, "shb, BTP port 3002")
    assert captain.err == "captain: without a message: 1 not GeoNetworking\n"


def test_message_that_does_not_decode_is_reported_with_path_bit_and_cause_and_the_next_decoded(captain):
    assert captain("decode", given=f"{BROKEN.hex()}\n02zz\n{DOOR_PDU.hex()}\n") == 1
    assert captain.out.startswith("door-1.1: a standard, 9 octets, standard input: line 3\n")
    first, cause, second, _ = captain.err.splitlines()
    assert first == ("captain: standard input: line 1: door-1.1: body.height: bit 56: out of range: 99 is not in 0..9")
    assert tells(cause, "  (", "damaged")
    assert second == "captain: standard input: line 2: character 3, 'z', is not a hexadecimal digit"


def test_a_message_that_does_not_decode_is_an_object_as_well(captain):
    assert captain("decode", "--json", BROKEN.hex(), "zz") == 1
    broken, wrong = captain.lines
    assert broken.pop("hint").startswith("it was damaged")
    assert broken == {
        "origin": "the argument",
        "octets": 9,
        "hex": BROKEN.hex(),
        "error": "the argument: door-1.1: body.height: bit 56: out of range: 99 is not in 0..9",
        "nearest_edition": "door-1.1",
        "path": "body.height",
        "bit": 56,
        "reason": "out of range: 99 is not in 0..9",
    }
    assert "character 1, 'z'" in wrong["error"]
    assert wrong.keys() == {"error", "hint"}
    assert captain.err == ""


def test_edition_that_is_asked_for_decides(captain):
    assert captain("decode", "--json", "--edition", "ball-1.1", BALL_PDU.hex()) == 0
    assert captain.lines[0]["edition"] == "ball-1.1"
    assert captain("decode", "--edition", "ball-1.1", octets(NEW, 1, 2).hex()) == 1
    assert tells(captain.err, "(", "another edition", "ball-2.1)")


def test_edition_that_is_unknown_is_refused_once_with_the_nearest_one(captain):
    assert captain("decode", "--edition", "bal", DOOR_PDU.hex()) == 1
    assert tells(captain.err, "captain: --edition: ", "'bal'", "ball?", "`captain decode --list`")
    assert captain.err.count("captain: ") == 1


def test_the_editions_can_be_listed(captain):
    assert captain("decode", "--list") == 0
    assert "5 messages" in captain.out
    assert "ball-1.1         66     1, 2  3001  a standard\n" in captain.out
    assert captain("decode", "--list", "--json", "--edition", "bare") == 0
    assert captain.lines[0]["message_ids"] == []


@pytest.mark.parametrize("verb", ["decode", "encode", "explain"])
def test_command_without_the_library_fails_with_make_codec(monkeypatch, capsys, without_library, verb):
    captain = Captain(monkeypatch, capsys)
    assert captain(verb, "0202") == 1
    assert tells(captain.err, "captain: ", "message library", "make codec")
    assert captain.err.count("captain: ") == 1


@pytest.mark.parametrize("verb", ["decode", "encode", "explain", "convert"])
def test_command_without_a_message_fails(captain, verb):
    assert captain(verb) == 1
    assert tells(captain.err, "captain: standard input: ", "no message")
    assert captain.err.count("\n") == 1


def test_text_of_a_file_name_cannot_move_the_cursor(captain):
    assert captain("decode", "\x1b[2J/x.hex") == 1
    assert "\x1b" not in captain.err


# -- encode


def test_encode_is_the_inverse_of_decode(captain):
    pdus = [DOOR_PDU, BALL_PDU, octets(NEW, 1, 2), octets(OLD, 7, version=1)]
    assert captain("decode", "--json", given="\n".join(pdu.hex() for pdu in pdus)) == 0
    assert captain("encode", given=captain.out) == 0
    assert captain.out.split() == [pdu.hex() for pdu in pdus]


def test_objects_of_many_lines_are_encoded_as_well(captain):
    captain("decode", "--json", DOOR_PDU.hex())
    assert captain("encode", given=2 * (json.dumps(captain.lines[0], indent=2) + "\n")) == 0
    assert captain.out.split() == [DOOR_PDU.hex()] * 2


def changed(edition: object = "door-1.1", **body: object) -> str:
    head = {"protocolVersion": 2, "messageID": 67, "stationID": 1337}
    return json.dumps({"edition": edition, "message": {"header": head, "body": {"width": 1, "height": 2, **body}}})


def test_a_value_that_cannot_be_is_told_with_path_value_and_range_and_the_next_goes_on(captain):
    assert captain("encode", given=f"{changed(depth=99)}\n{changed(depth=3)}\n") == 1
    assert captain.out == DOOR_PDU.hex() + "\n"
    assert captain.err == ("captain: standard input: line 1: door-1.1: body.depth: out of range: 99 is not in 0..9\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"message": {}}', 'edition is missing\n  (add "edition" or pass --edition cam-1.4.1)'),
        ('{"header": {"messageID": 67}}', 'edition is missing\n  (add "edition" or pass --edition door-1.1)'),
        ('{"edition": "door-9", "message": {}}', "edition: unknown edition 'door-9'\n  (did you mean door-1.1?)"),
        ('{"edition": "door-of-the-barn", "message": {}}', "unknown edition 'door-of-the-barn'\n  (known: door-1.1)"),
        ('{"edition": 7, "message": {}}', "edition: 7 is not a text"),
        ('{"edition": "door-1.1"}', '"message" is missing'),
        ('{"edition": "door-1.1", "message": 7}', "message: 7 is not an object"),
        ('{"error": {"reason": "x"}}', "it is an error of `captain decode`, without a message"),
        ('{"error": "x", "hint": "", "edition": "door-1.1"}', "it is an error of `captain decode`, without a message"),
        ('{"edition": "door-1.1", "message": {"a": NaN}}', "it is not JSON: NaN is not a JSON number"),
        ("{", "it is not JSON"),
        ("[7]", "item 0: '7' is not an object"),
        ("0202", "it is not JSON"),
    ],
)
def test_an_object_that_says_no_message_is_refused_with_a_remedy(captain, text, words):
    assert captain("encode", given=text) == 1
    assert captain.err.startswith("captain: standard input: line 1: ")
    assert words in captain.err
    assert captain.out == ""


def test_with_an_edition_the_object_may_be_the_message_alone(captain):
    alone = json.dumps(json.loads(changed(depth=3))["message"])
    assert captain("encode", "--edition", "door", alone) == 0
    assert captain.out == DOOR_PDU.hex() + "\n"


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ({"messageID": 9}, "door-1.1: header: messageID 9 is unknown; door has 67"),
        ({"protocolVersion": 7}, "door-1.1: header: protocolVersion is 7, this edition has 2"),
    ],
)
@pytest.mark.parametrize("command", [["encode", "--edition", "door"], ["encode"], ["convert"]])
def test_encode_of_a_header_that_no_edition_has_warns(captain, command, head, words):
    one = json.loads(changed(depth=3))
    one["message"]["header"] |= head
    assert captain(*command, json.dumps(one)) == 0
    assert captain.out.strip()[12:] == DOOR_PDU.hex()[12:]
    assert captain.err == f"captain: warning: the argument: {words}\n"


@pytest.mark.parametrize("command", [["encode", "--edition", "ball-1.2"], ["encode"], ["convert"]])
def test_encode_of_a_header_of_another_edition_is_refused_without_force(captain, command):
    header = {"protocolVersion": 1, "messageID": 66, "stationID": 1337}
    one = json.dumps({"edition": "ball-1.2", "message": {"header": header, "body": {"size": 7}}})
    assert captain(*command, one) == 1
    assert captain.err == (
        "captain: the argument: ball-1.2: header: protocolVersion is 1, this edition has 2\n"
        "  (name ball-1.1, or add --force)\n"
    )
    assert captain(*command, "--force", one) == 0
    assert captain.out == octets(OLD, 7, version=1).hex() + "\n"


def test_encode_of_a_header_of_another_type_is_refused(captain):
    one = json.loads(changed(depth=3))
    one["message"]["header"]["messageID"] = 66
    assert captain("encode", json.dumps(one)) == 1
    assert "door-1.1: header: messageID 66 announces ball; door has 67\n  (change the header" in captain.err


@pytest.mark.parametrize("named", [{}, {"edition": "ball"}])
def test_encode_without_an_exact_edition_takes_that_of_the_header(captain, named):
    message = {"header": {"protocolVersion": 1, "messageID": 66, "stationID": 1337}, "body": {"size": 7}}
    one = {**named, "message": message} if named else message
    assert captain("encode", json.dumps(one)) == 0
    assert captain.out == octets(OLD, 7, version=1).hex() + "\n"
    message["body"]["size"] = 150
    assert captain("encode", json.dumps(one)) == 1
    assert "ball-1.1: body.size: out of range: 150 is not in 0..100" in captain.err


def test_decode_of_invalid_hexadecimal_names_the_option_for_the_format(captain):
    assert captain("decode", "zz") == 1
    assert "--format" in captain.err


def test_object_of_another_edition_than_asked_for_is_refused(captain):
    assert captain("encode", "--edition", "ball", changed(depth=3)) == 1
    assert tells(captain.err, "edition: door-1.1 ", "--edition ball\n", "omit --edition")


def test_encode_writes_other_forms(captain, tmp_path):
    assert captain("encode", changed(depth=3), "-o", str(tmp_path / "x.bin")) == 0
    assert (tmp_path / "x.bin").read_bytes() == DOOR_PDU


# -- convert


def test_convert_goes_around_through_every_form(captain, tmp_path):
    came = str(tmp_path / "x.hex")
    (tmp_path / "x.hex").write_text(BALL_PDU.hex())
    for suffix in ("b64", "bin", "jsonl", "hex"):
        to = str(tmp_path / f"y.{suffix}")
        assert captain("convert", came, "-o", to) == 0
        came = to
    assert (tmp_path / "y.hex").read_text() == BALL_PDU.hex() + "\n"


def test_convert_of_octets_needs_no_library(monkeypatch, capsys, without_library):
    captain = Captain(monkeypatch, capsys)
    assert captain("convert", "--to", "base64", "0202") == 0
    assert captain.out == "AgI=\n"
    assert captain("convert", "--to", "json", "0202") == 1
    assert "make codec" in captain.err


def test_octets_come_before_fields(captain):
    line = json.dumps(json.loads(changed(depth=3)) | {"hex": BALL_PDU.hex()})
    assert captain("convert", line) == 0
    assert captain.out == BALL_PDU.hex() + "\n"


def test_convert_refuses_what_is_not_of_the_edition_that_was_asked_for(captain):
    assert captain("convert", "--edition", "ball", BALL_PDU.hex(), DOOR_PDU.hex()) == 1
    assert captain.out == BALL_PDU.hex() + "\n"
    header = "header: messageID 67 and protocolVersion 2 are those of door-1.1, but --edition is ball"
    assert f"captain: the argument: {header}\n" in captain.err


@pytest.mark.parametrize("option", ["--format", "--from", "--form"])
def test_convert_with_a_format_of_the_input_reads_it(captain, option):
    assert captain("convert", option, "base64", "AgIC") == 0
    assert captain.out == "020202\n"
    assert captain("convert", option, "hex", "AgIC") == 1


# -- explain


def test_explain_has_a_row_for_each_field(captain):
    assert captain("explain", DOOR_PDU.hex()) == 0
    rows = captain.out.splitlines()
    assert rows[0] == "door-1.1: a standard, 9 octets, the argument"
    assert rows[1].split() == ["bit", "width", "bits", "X.691", "field", "value"]
    assert rows[2].split() == ["48", "body", "Body"]
    assert rows[4].split() == ["56", "8", "00000010", "11.5.7.2", "height", "2", "m"]


def test_explain_of_a_message_that_does_not_decode_ends_at_the_first_bad_bit(captain):
    assert captain("explain", BROKEN.hex()) == 1
    assert "body.height: bit 56: out of range: 99 is not in 0..9" in captain.out
    assert tells(captain.err, "door-1.1: body.height: bit 56: out of range", "\n  (", "damaged")


def test_explain_json_has_a_row_a_line(captain):
    assert captain("explain", "--json", DOOR_PDU.hex()) == 0
    assert captain.lines[2] == {
        "origin": "the argument",
        "edition": "door-1.1",
        "bit": 56,
        "width": 8,
        "name": "height",
        "path": "body.height",
        "value": "2 m",
        "bits": "00000010",
        "clause": "11.5.7.2",
    }
    assert captain("explain", "--json", BROKEN.hex()) == 1
    last = captain.lines[-1]
    assert (last["bit"], last["path"], last["nearest_edition"]) == (56, "body.height", "door-1.1")
    assert "edition" not in last
    assert isinstance(last["error"], str)
    assert isinstance(last["hint"], str)
