"""Input of other standards: named in one line, or decoded where only its layers were foreign."""

from pathlib import Path

import pytest

from firmware import cli
from tests.firmware.recordings.test_layers import CAM, PACKET, wlan

HERE = Path(__file__).parent
J2735 = [line for line in (HERE / "j2735.hex").read_text().splitlines() if not line.startswith("#")]
RADIOTAP = bytes.fromhex("00000d000080020000000000 00".replace(" ", ""))  # 13 octets: version, length, bitmap, fields
ONLY = "captain decodes messages of ETSI ITS only"
SRM = f"it is a MessageFrame of SAE J2735: messageId 29, SignalRequestMessage (SRM); {ONLY}"
SPAT = f"it is a MessageFrame of SAE J2735: messageId 19, SPAT; {ONLY}"
READ = "give hexadecimal, base64, octets, JSON (JER), pcap, pcapng or MCAP"


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]):
    """Standard output and the lines on standard error of a command that fails (1) or not (0)."""

    def run(status: int, *words: object) -> tuple[str, list[str]]:
        assert cli.main([str(word) for word in words]) == status
        said, told = capsys.readouterr()
        return said, told.splitlines()

    return run


@pytest.mark.parametrize("command", ["decode", "explain", "convert"])
def test_messages_of_j2735_are_named_in_a_line_each(run, command: str):
    file = HERE / "j2735.hex"
    more = ["--to", "json"] if command == "convert" else []
    said, told = run(1, command, file, *more)
    assert said == ""
    assert told == [f"captain: {file}: line 2: {SRM}", f"captain: {file}: line 3: {SPAT}"]


@pytest.mark.parametrize("form", ["hex", "base64", "binary"])
def test_the_octets_of_a_message_of_j2735_are_converted_with_a_warning(run, tmp_path: Path, form: str):
    out = tmp_path / "out"
    _, told = run(0, "convert", J2735[1], "--to", form, "-o", out)
    assert told == [f"captain: warning: the argument: {SPAT}"]
    assert run(0, "convert", out, "--format", form, "--to", "hex")[0] == f"{J2735[1].lower()}\n"


def test_a_message_of_j2735_is_not_put_into_a_geonetworking_packet(run, tmp_path: Path):
    _, told = run(1, "convert", J2735[0], "-o", tmp_path / "out.pcap")
    assert told == [f"captain: the argument: {SRM}"]


def test_a_message_of_j2735_as_json_has_its_octets_and_its_name(run):
    said, told = run(1, "decode", "--json", J2735[0])
    assert f'"hex": "{J2735[0].lower()}"' in said
    assert SRM in said
    assert told == []


def test_a_message_of_j2735_that_is_cut_off_is_named_with_its_sizes(run):
    _, told = run(1, "decode", J2735[0][:-10])
    cause = "truncated SAE J2735 MessageFrame (messageId 29, SignalRequestMessage (SRM)): 36 of 41 octets"
    assert told[-1] == f"  ({cause})"


@pytest.mark.parametrize("frame", [RADIOTAP + wlan(0x88, 0x00, 2), wlan(0x08, 0x00, 0), bytes(14) + CAM[12:]])
def test_a_frame_of_another_link_layer_in_hexadecimal_is_opened(run, frame: bytes):
    said, told = run(0, "convert", frame.hex(), "--to", "hex")
    assert said == f"{CAM[-41:].hex()}\n"
    assert told == []


def test_radiotap_in_hexadecimal_is_decoded_and_what_carried_it_is_shown(run):
    said, told = run(0, "decode", "--json", (RADIOTAP + wlan(0x88, 0x00, 2)).hex())
    assert '"edition": "cam-' in said
    assert '"carried": "shb, BTP port 2001"' in said
    assert told == []


def test_radiotap_without_a_message_is_named(run):
    frame = RADIOTAP + b"\x80\0" + bytes(40)  # a beacon of 802.11
    _, told = run(1, "decode", frame.hex())
    assert told == ["captain: the argument: radiotap frame without an ITS message: not GeoNetworking"]


def test_radiotap_with_a_packet_that_is_cut_off_is_refused_with_its_reason(run):
    frame = RADIOTAP + wlan(0x08, 0x00, 0)[: -len(PACKET) + 30]
    (told,) = run(1, "decode", frame.hex())[1]
    assert told.startswith("captain: the argument: ")
    assert "messageID" not in told


@pytest.mark.parametrize("command", ["decode", "explain", "convert", "encode"])
@pytest.mark.parametrize(
    ("text", "root"),
    [
        ("<CAM><header/></CAM>", "root element CAM"),
        ('<?xml version="1.0" encoding="UTF-8"?>\n<!-- made by\n <nobody> -->\n<DENM>\n  <header/>\n</DENM>\n', "root element DENM"),
        ("\ufeff<!DOCTYPE x>\n<MessageFrame>\n<messageId>20</messageId>\n</MessageFrame>", "root element MessageFrame"),
        ("\n<ns:CAM xmlns:ns='urn:x'\n/>", "root element ns:CAM"),
        ("<!-- nothing -->", "no root element"),
    ],
)  # fmt: skip
def test_xer_is_named_by_its_root_element_in_one_line(run, tmp_path: Path, command: str, text: str, root: str):
    (tmp_path / "a.xer").write_text(text)
    said, told = run(1, command, tmp_path / "a.xer")
    line = 2 if text.startswith("\n") else 1
    assert said == ""
    assert told == [f"captain: {tmp_path / 'a.xer'}: line {line}: XER or other XML is not read: {root}; {READ}"]


def test_xer_as_an_argument_is_no_name_of_a_file(run):
    assert run(1, "decode", "<CAM><header/></CAM>")[1] == [
        f"captain: the argument: XER or other XML is not read: root element CAM; {READ}"
    ]


def test_lines_beside_xer_of_one_line_are_read(run, tmp_path: Path):
    (tmp_path / "mixed.txt").write_text("<CAM></CAM>\n0202000000010203\n<DENM/>\n")
    said, told = run(1, "convert", tmp_path / "mixed.txt", "--to", "hex")
    assert said == "0202000000010203\n"
    assert [line.partition("element ")[2].partition(";")[0] for line in told] == ["CAM", "DENM"]


def test_a_file_that_begins_with_a_byte_order_mark_is_read(run, tmp_path: Path):
    (tmp_path / "cam.hex").write_bytes(b"\xef\xbb\xbf" + CAM[-41:].hex().encode() + b"\r\n")
    assert run(0, "convert", tmp_path / "cam.hex", "--to", "hex") == (f"{CAM[-41:].hex()}\n", [])
