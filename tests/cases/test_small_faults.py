"""A list with one invalid line: every command that reads lists uses the others."""

import json
import socket
from pathlib import Path

import pytest

from drivers.wire import frame
from firmware import cli
from tests.firmware.commands.fake import FakeStation
from tests.firmware.commands.test_send import sent_by

LIST = Path(__file__).parent / "one-invalid-of-27.hex"
VALID = set(range(1, 28)) - {14}
WHY = "one-invalid-of-27.hex: line 15: character 6, 'O', is not a hexadecimal digit"


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    """No station of this machine is asked by its control socket."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def station_id(pdu: bytes) -> int:
    return int.from_bytes(pdu[2:6])


def test_send_with_one_invalid_line_of_27_sends_26(capsys):
    with FakeStation(answer=sent_by("g5")) as station:
        assert cli.main(["send", *station.options, "--rate", "0", str(LIST)]) == 1
    assert {station_id(frames[1]) for frames in station.requests} == VALID
    said = capsys.readouterr()
    assert WHY in said.err
    assert "26 given to the station: 26 sent; 1 invalid, not sent" in said.out


def test_replay_with_one_invalid_line_of_27_sends_26(capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5)
        to = "{}:{}".format(*ear.getsockname())
        assert cli.main(["replay", str(LIST), "--udp", to, "--framing", "pdu", "--rate", "0"]) == 1
        assert {station_id(ear.recv(2048)) for _ in VALID} == VALID
    said = capsys.readouterr().err
    assert WHY in said
    assert "26 sent of 26 read" in said
    assert "1 unreadable" in said


def test_convert_with_one_invalid_line_of_27_converts_26(capsys):
    assert cli.main(["convert", str(LIST)]) == 1
    said = capsys.readouterr()
    assert {station_id(bytes.fromhex(line)) for line in said.out.split()} == VALID
    assert WHY in said.err


@pytest.mark.parametrize("command", ["decode", "explain"])
def test_decode_with_one_invalid_line_of_27_shows_26(capsys, command):
    assert cli.main([command, str(LIST)]) == 1
    said = capsys.readouterr()
    assert said.out.count("one-invalid-of-27.hex: line ") == 26
    assert WHY in said.err


def test_encode_with_one_invalid_line_of_27_encodes_26(capsys, tmp_path):
    assert cli.main(["decode", "--json", str(LIST)]) == 1
    objects = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert ["error" in one for one in objects].count(True) == 1
    (tmp_path / "27.jsonl").write_text("\n".join(json.dumps(one) for one in objects))
    assert cli.main(["encode", str(tmp_path / "27.jsonl")]) == 1
    said = capsys.readouterr()
    assert {station_id(bytes.fromhex(line)) for line in said.out.split()} == VALID
    assert "27.jsonl: line 14: " in said.err


def test_a_frame_of_each_valid_line_leaves_where_it_is_replayed_as_frames():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5)
        assert cli.main(["replay", str(LIST), "--udp", "{}:{}".format(*ear.getsockname()), "--rate", "0"]) == 1
        assert all(isinstance(frame.unwrap(ear.recv(2048)), frame.Ethernet) for _ in VALID)


def test_decoded_message_in_place_of_octets_is_encoded_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    octets = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
    assert cli.main(["decode", "--json", octets]) == 0
    (tmp_path / "one.json").write_text(capsys.readouterr().out)
    assert cli.main(["convert", "--to", "hex", str(tmp_path / "one.json")]) == 0
    assert capsys.readouterr().out == f"{octets}\n"
    assert cli.main(["decode", str(tmp_path / "one.json")]) == 0
    assert capsys.readouterr().out.startswith("cam-1.4.1: ")
