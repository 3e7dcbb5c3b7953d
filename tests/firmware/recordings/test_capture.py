import io
import json
import shutil
import struct
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError, RequestError
from firmware.recordings import capture
from tests.firmware.codec.captures import (
    WHEN_NS,
    block,
    enhanced,
    interface,
    pcap,
    pcapng,
    section,
    simple,
)

FRAMES = [b"one frame", b"another", b""]


def read(octets: bytes) -> list[capture.Frame]:
    return list(capture.frames(octets[:4], io.BytesIO(octets[4:])))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("magic", [0xA1B2C3D4, 0xA1B23C4D])
def test_pcap_of_both_byte_orders_and_both_units_of_time_is_read(order, magic):
    found = read(pcap(FRAMES, order, magic, link=127))
    assert [one.octets for one in found] == FRAMES
    assert found[1] == capture.Frame(2, 127, WHEN_NS, b"another", 0)


@pytest.mark.parametrize("order", ["<", ">"])
def test_pcapng_of_both_byte_orders_is_read(order):
    found = read(pcapng(FRAMES, order, link=105))
    assert [one.octets for one in found] == FRAMES
    assert found[1] == capture.Frame(2, 105, WHEN_NS, b"another", 0)


def test_each_interface_of_pcapng_has_its_link_type_and_clock():
    nanoseconds = struct.pack("<HHB3xHHq", 9, 1, 9, 14, 8, 1_000_000_000)
    binary = struct.pack("<HHB3x", 9, 1, 0x80 | 10)
    octets = section() + interface(1, options=nanoseconds) + interface(113, options=binary)
    octets += enhanced(b"a", 5) + enhanced(b"b", 3 << 9, index=1)
    first, second = read(octets)
    assert (first.link, first.when_ns) == (1, 10**18 + 5)
    assert (second.link, second.when_ns) == (113, 1_500_000_000)


def test_a_new_section_has_interfaces_of_its_own():
    found = read(pcapng([b"a"], "<", link=1) + pcapng([b"b"], ">", link=127))
    assert [(one.link, one.number) for one in found] == [(1, 1), (127, 2)]


def test_simple_packets_have_no_time_and_are_cut_by_the_interface():
    cut = block(3, struct.pack("<I", 100) + b"abcd")
    found = read(section() + interface(snap_length=4) + simple(b"wxyz") + cut)
    assert [(one.octets, one.when_ns, one.missing) for one in found] == [(b"wxyz", None, 0), (b"abcd", None, 96)]


def test_blocks_of_other_kinds_are_passed_over():
    assert len(read(section() + block(5, bytes(8)) + interface() + block(0xBAD, b"x") + enhanced(b"a", 1))) == 1


def test_a_frame_says_what_of_it_was_not_captured():
    octets = pcap([]) + struct.pack("<IIII", 0, 0, 2, 60) + b"ab"
    assert read(octets)[0].missing == 58


@pytest.mark.parametrize(
    ("octets", "words"),
    [
        (pcap(FRAMES)[:20], "it is cut off in its header: 16 of 20 octets"),
        (pcap(FRAMES)[:-3], "truncated after frame 2"),
        (pcap([b"abcd"])[:-1], "it is cut off in frame 1: 3 of 4 octets"),
        (pcap([]) + struct.pack("<IIII", 0, 0, 1 << 30, 0), "frame 1 claims 1073741824 octets"),
        (pcapng([b"abcd"])[:-1], "it is cut off in the block after frame 0"),
        (section() + struct.pack("<II", 6, 13), "the block after frame 0 claims 13 octets"),
        (section() + enhanced(b"a", 1), "its interface is missing"),
        (section() + simple(b"a"), "its interface is missing"),
        (section() + interface() + block(6, bytes(12)), "ends too early"),
        (section() + interface() + block(6, struct.pack("<IIIII", 0, 0, 0, 9, 9)), "frame 1 claims 9 octets and has 0"),
        (b"\x0a\x0d\x0d\x0a" + bytes(8), "byte-order magic 00000000, which is invalid"),
        (b"abcd", "61626364: not the start of a pcap"),
    ],
)
def test_a_capture_that_is_damaged_is_refused_with_the_place(octets, words):
    with pytest.raises(ProtocolError, match=words):
        read(octets)


@given(
    st.sampled_from([*map(bytes, capture.PCAP), capture.PCAPNG, section() + interface(), pcap([b"a"])]),
    st.binary(max_size=80),
)
def test_random_octets_are_taken_or_explained(head, octets):
    try:
        assert all(isinstance(one, capture.Frame) for one in read(head + octets))
    except ProtocolError as error:
        assert error.message


def test_a_pipe_that_gives_octets_in_pieces_is_no_capture_cut_off():
    class Pieces(io.RawIOBase):
        def __init__(self, octets: bytes) -> None:
            self.left = octets

        def read(self, size: int = -1) -> bytes:
            piece, self.left = self.left[:1], self.left[1:]
            return piece

    octets = pcap(FRAMES)
    assert len(list(capture.frames(octets[:4], Pieces(octets[4:])))) == 3


@pytest.mark.parametrize("when_ns", [-1, 10**9 << 32])
def test_a_time_that_pcap_cannot_say_is_refused(when_ns):
    # pcapng has 64 bits and an offset, pcap 32 bits of seconds
    with pytest.raises(RequestError, match=f"{when_ns // 10**9} s"):
        capture.record(b"frame", when_ns)
    assert len(capture.record(b"frame", (10**9 << 32) - 1)) == 21


def test_what_is_written_is_read_again_and_by_tshark(tmp_path):
    octets = capture.header() + capture.record(b"\xff" * 14 + b"payload", WHEN_NS)
    assert read(octets) == [capture.Frame(1, 1, WHEN_NS, b"\xff" * 14 + b"payload", 0)]
    if shutil.which("tshark") is None:
        pytest.fail("tshark is missing: install the package tshark")
    (tmp_path / "x.pcap").write_bytes(octets)
    command = ["tshark", "-n", "-r", str(tmp_path / "x.pcap"), "-T", "json"]
    shown = json.loads(subprocess.run(command, capture_output=True, check=True, timeout=60).stdout)
    assert shown[0]["_source"]["layers"]["frame"]["frame.len"] == "21"
