"""Screens of decode, encode, explain and convert: a message, a bad one, many, and a wrong edition."""

from pathlib import Path

import pytest

from firmware.codec.decoding import Decoder, record
from firmware.codec.library import load
from firmware.codec.reading import Pdu
from firmware.lab.laboratory import vectors
from tests.screens.terminal import Terminal, compare

PDUS = {vector.name: vector.pdu.hex() for vector in vectors()}
CAM, DENM = PDUS["cam 46"], PDUS["denm 404"]


def test_a_decoded_cam_begins_with_its_edition(terminal: Terminal) -> None:
    terminal.run("decode", CAM)
    compare("decode", terminal.lines())


def test_a_list_of_editions_is_a_table(terminal: Terminal) -> None:
    terminal.run("decode", "--list")
    compare("decode-list", terminal.lines())


@pytest.mark.parametrize("verb", ["decode", "explain"])
def test_truncated_message_ends_with_the_error(verb: str, terminal: Terminal) -> None:
    terminal.run(verb, DENM[:40])
    compare(f"{verb}-bad", terminal.lines())


def test_explain_of_a_denm_shows_its_bits(terminal: Terminal) -> None:
    terminal.run("explain", DENM)
    compare("explain", terminal.lines())


def test_an_encoded_message_is_one_line_of_digits(terminal: Terminal) -> None:
    pdu = Pdu(bytes.fromhex(CAM), "the argument")
    terminal.run("encode", record(pdu, Decoder(load()).identify(pdu)))
    compare("encode", terminal.lines())


def test_encoding_of_a_wrong_value_names_its_path(terminal: Terminal) -> None:
    terminal.run("encode", '{"edition": "cam-1.4.1", "message": {"header": {"protocolVersion": 300}}}')
    compare("encode-bad", terminal.lines())


def test_conversion_of_a_capture_prints_its_messages(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drive.hex").write_text(f"{CAM}\nno message\n{DENM}\n")
    terminal.run("convert", "drive.hex", "--to", "base64")
    compare("convert", terminal.lines())
