"""Received messages in MCAP recordings: what `captain record` writes, truncated, compressed, of others."""

import io
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.message import Position, RxInfo
from drivers.wire.raw import RawRx
from firmware.client.received import Message
from firmware.lab.laboratory import vectors
from firmware.recordings import mcap, reception
from firmware.recordings.mcap import Mcap

GATEWAY = Path(__file__).resolve().parents[3] / "firmware/gateway/captain_gateway_msgs/msg/Metadata.msg"
NS = 1_795_182_426_461_613_000
MAC = bytes.fromhex("010203040506")
PDUS = [one.pdu for one in vectors()]


def recording(*pdus: bytes, source: str = "") -> bytes:
    stream = io.BytesIO()
    one = Mcap(stream, "ros2", "test")
    cam = one.channel("cam/received", "etsi_its_cam_msgs/msg/CAM", "uint8 it", {})
    metadata = one.channel("cam/received/metadata", reception.TYPE, reception.SCHEMA, {})
    for at, pdu in enumerate(pdus):
        rx = RxInfo(btp_port=2001, rssi_dbm=-71, source_mac=MAC, source=source)
        message = Message("cam", pdu, RawRx(pdu, NS + at, rx, (NS, Position(1, 2))))
        one.add(cam, NS + at, b"\0\1\0\0")
        one.add(metadata, NS + at, reception.cdr(message, NS + at, at + 1, "cam-1.4.1"))
    one.close()
    return stream.getvalue()


def read(octets: bytes) -> tuple[list[reception.Reception], Counter[str]]:
    stream, skipped = io.BytesIO(octets), Counter[str]()
    return list(reception.receptions(stream.read(4), stream, skipped)), skipped


@pytest.mark.parametrize("source", ["", "a", "vehicle-17"])
def test_every_octet_comes_back_with_its_time_port_and_sender(source):
    found, skipped = read(recording(*PDUS, source=source))
    assert [(one.pdu, one.when_ns) for one in found] == [(pdu, NS + at) for at, pdu in enumerate(PDUS)]
    assert {(one.port, one.source_mac) for one in found} == {(2001, MAC)}
    assert skipped == {"on topic cam/received, without octets of PDUs": len(PDUS)}


def test_what_was_written_before_a_cut_comes_and_then_the_error():
    octets = recording(*PDUS)
    stream = io.BytesIO(octets[: len(octets) // 2])
    with pytest.raises(ProtocolError, match="truncated or malformed record"):
        list(reception.receptions(stream.read(4), stream, Counter()))


def test_compressed_chunks_are_refused_by_name():
    octets = recording(PDUS[0])
    at = octets.index(b"\6", 20)
    chunk = octets[: at + 9 + 28] + b"\3\0\0\0lz4" + octets[at + 9 + 32 :]
    with pytest.raises(ProtocolError, match="lz4"):
        read(chunk)


@given(octets=st.binary(max_size=400), cut=st.integers(0, 2000), flip=st.integers(0, 20_000))
def test_any_octets_are_taken_or_explained(octets: bytes, cut: int, flip: int):
    whole = bytearray(recording(*PDUS[:3]))
    whole[flip % len(whole)] ^= 0x55
    for one in (
        octets,
        mcap.HEAD + octets,
        mcap.HEAD + b"0\r\n"[:3] + octets,
        bytes(whole),
        bytes(whole[:cut]),
    ):
        try:
            read(one)
        except ProtocolError:
            continue


def test_the_codec_knows_it_by_its_looks(tmp_path, capsys):
    from firmware import cli

    path = tmp_path / "drive.mcap"
    path.write_bytes(recording(*PDUS))
    assert cli.main(["convert", str(path), "--to", "hex"]) == 0
    assert [bytes.fromhex(line) for line in capsys.readouterr().out.split()] == PDUS


def test_the_definition_is_that_of_the_gateway():
    lines = (line.partition("#")[0].strip() for line in GATEWAY.read_text(encoding="utf-8").splitlines())
    assert reception.DEFINITION.splitlines() == [line for line in lines if line]
