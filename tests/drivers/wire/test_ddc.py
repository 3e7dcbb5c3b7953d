"""Registers of a receiver at an I2C bus (DDC)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.wire.ddc import MOST, Ddc


class Chip:
    """Fake receiver that records the octets written to it."""

    def __init__(self, stream=b"", waiting=None):
        self.stream = stream
        self.waiting = waiting
        self.register = None
        self.written = []

    def transfer(self, address, write, read):
        assert address == 0x42
        self.register = write[0]
        if len(write) > 1:
            self.written.append(write)
        if self.register == 0xFD and read:
            waiting = len(self.stream) if self.waiting is None else self.waiting
            return waiting.to_bytes(2)[:read]
        octets, self.stream = self.stream[:read], self.stream[read:]
        return octets.ljust(read, b"\xff")


@given(stream=st.binary(max_size=1000))
def test_a_stream_is_read_whole_and_without_what_is_beyond_its_end(stream):
    ddc, found = Ddc(Chip(stream)), []
    while octets := ddc.read():
        assert len(octets) <= MOST
        found.append(octets)
    assert b"".join(found) == stream


@pytest.mark.parametrize("waiting", [0, 0xFFFF])
def test_a_receiver_that_has_nothing_or_is_starting_is_not_read(waiting):
    chip = Chip(b"x", waiting)
    assert Ddc(chip).read() == b""
    assert chip.register == 0xFD


@pytest.mark.parametrize("size", [2, 8, MOST - 1, MOST, MOST + 1, MOST + 2, 2 * MOST + 1, 1029])
def test_a_frame_is_written_in_parts_of_two_octets_and_more(size):
    chip = Chip()
    frame = bytes(at % 251 for at in range(size))
    Ddc(chip).write(frame)
    assert b"".join(chip.written) == frame
    assert all(2 <= len(part) <= MOST for part in chip.written)
