import argparse
import base64
import io
from pathlib import Path

import pytest

from board.runtime.errors import RequestError, StationError
from firmware.codec import writing
from firmware.codec.reading import Pdu
from firmware.recordings import capture
from firmware.recordings.layers import Carried, open_frame
from tests.firmware.codec.captures import WHEN_NS
from tests.firmware.codec.standin import DOOR
from tests.firmware.codec.standin import octets as octets_of
from tests.firmware.recordings.test_layers import FRAMES

CAM = bytes.fromhex("02020000053900010203")
PDU = Pdu(CAM, "the argument")


def written(pdus: list[Pdu], path: Path, form: str | None = None) -> bytes:
    parser = argparse.ArgumentParser()
    writing.add_output(parser)
    words = ["-o", str(path), *(["--to", form] if form else [])]
    asked = argparse.Namespace(edition=None, force=False, **vars(parser.parse_args(words)))
    with writing.output(asked, "hex") as out:
        for pdu in pdus:
            out.write(pdu)
    return path.read_bytes()


def frames(octets: bytes) -> list[capture.Frame]:
    return list(capture.frames(octets[:4], io.BytesIO(octets[4:])))


@pytest.mark.parametrize(
    ("name", "octets"),
    [
        ("x.hex", CAM.hex().encode() + b"\n"),
        ("x.B64", base64.b64encode(CAM) + b"\n"),
        ("x.bin", CAM),
        ("x", CAM.hex().encode() + b"\n"),
    ],
)
def test_the_name_of_the_file_says_the_form(tmp_path, name, octets):
    assert written([PDU], tmp_path / name) == octets


def test_the_form_that_is_asked_for_comes_before_the_name(tmp_path):
    assert written([PDU], tmp_path / "x.bin", "base64") == base64.b64encode(CAM) + b"\n"


@pytest.mark.parametrize("name", ["x.pcapng", "x.dat"])
def test_a_name_that_says_nothing_known_is_refused_and_nothing_is_written(tmp_path, name):
    with pytest.raises(RequestError, match="unknown output format"):
        written([PDU], tmp_path / name)
    assert not (tmp_path / name).exists()


def test_a_bare_message_gets_the_frame_of_a_single_hop_broadcast(tmp_path):
    (frame,) = frames(written([PDU], tmp_path / "x.pcap"))
    found = open_frame(frame.link, frame.octets)
    assert found == Carried(CAM, 2001, "shb", False)
    assert frame.octets[6:12] == bytes.fromhex("020000000539"), "it ends in the stationID"
    assert frame.when_ns == 0


def test_a_message_that_came_in_a_frame_keeps_it_with_its_time(tmp_path):
    signed = FRAMES["cam-signed-certificate"]
    (frame,) = frames(written([Pdu(CAM, "x", 2001, WHEN_NS, "", signed)], tmp_path / "x.pcap"))
    assert (frame.octets, frame.when_ns) == (signed, WHEN_NS)


def test_the_port_that_is_known_comes_before_that_of_the_type(tmp_path):
    (frame,) = frames(written([PDU._replace(port=4711)], tmp_path / "x.pcap"))
    found = open_frame(frame.link, frame.octets)
    assert isinstance(found, Carried)
    assert found.btp_port == 4711


@pytest.mark.parametrize("octets", [b"\x02", b"\x02\xc8\0\0\0\0"])
def test_a_message_without_a_port_has_no_frame(tmp_path, octets, without_library):
    with pytest.raises(RequestError, match="here: no BTP port is known for it"):
        written([Pdu(octets, "here")], tmp_path / "x.pcap")


def test_a_message_of_the_library_has_a_port_though_the_table_of_types_has_none(tmp_path, standin):
    door = octets_of(DOOR, 1, 2, 3)
    (frame,) = frames(written([Pdu(door, "here")], tmp_path / "x.pcap"))
    assert open_frame(frame.link, frame.octets) == Carried(door, 3002, "shb", False)


def test_binary_holds_one_message_only(tmp_path):
    with pytest.raises(RequestError, match="second: binary holds one message only"):
        written([PDU, Pdu(CAM, "second")], tmp_path / "x.bin")
    assert (tmp_path / "x.bin").read_bytes() == CAM


def test_a_file_that_cannot_be_written_ends_it(tmp_path):
    with pytest.raises(StationError, match=r"no/x\.hex: No such file"):
        written([PDU], tmp_path / "no" / "x.hex")
