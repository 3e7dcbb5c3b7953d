"""Lists of v2x_gw: a header, a count and a message, in XCDR1."""

import random

import pytest

from firmware.gateway.captain_gateway.captain_gateway.errors import RefusedError
from firmware.gateway.captain_gateway.captain_gateway.lists import unwrap, wrap

HEAD = b"\0\1\0\0"
MESSAGE = HEAD + (2).to_bytes(8, "little") + b"of a CAM"
STAMP_NS = 1_795_132_800_123_456_789
STAMP = (1_795_132_800).to_bytes(4, "little") + (123_456_789).to_bytes(4, "little")
# Behind the encapsulation: stamp, length of frame_id, itself and a zero; what is filled up; the count; what is filled up.
LISTS = {
    b"": STAMP + b"\1\0\0\0" + b"\0" + bytes(3) + b"\1\0\0\0" + bytes(4),
    b"map": STAMP + b"\4\0\0\0" + b"map\0" + b"\1\0\0\0" + bytes(4),
    b"captain": STAMP + b"\10\0\0\0" + b"captain\0" + b"\1\0\0\0",
}


@pytest.mark.parametrize("frame", LISTS)
def test_a_message_as_a_list_lies_where_cdr_has_it(frame):
    assert wrap(MESSAGE, STAMP_NS, frame) == HEAD + LISTS[frame] + MESSAGE[4:]


@pytest.mark.parametrize("length", range(20))
def test_a_message_comes_back_from_its_list(length):
    list_ = wrap(MESSAGE, STAMP_NS, b"f" * length)
    assert unwrap(list_) == MESSAGE
    assert (len(list_) - len(MESSAGE)) % 8 == 0


@pytest.mark.parametrize("count", [0, 2, 0xFFFFFFFF])
def test_a_list_of_none_or_of_several_is_refused_in_words(count):
    list_ = bytearray(wrap(MESSAGE, STAMP_NS, b"map"))
    list_[20:24] = count.to_bytes(4, "little")
    with pytest.raises(RefusedError, match=f"the list has {count} messages; only lists with one message are sent"):
        unwrap(bytes(list_))


def test_what_is_no_list_is_refused():
    list_ = wrap(MESSAGE, STAMP_NS, b"map")
    for octets in (b"", b"\0", list_[:12], list_[:18], b"\0\0" + list_[2:], list_[:12] + b"\xff" * 8 + list_[20:]):
        with pytest.raises(RefusedError, match="no list"):
            unwrap(octets)


def test_octets_of_chance_are_refused_or_taken_and_nothing_else():
    chance = random.Random(8)
    for _ in range(5000):
        try:
            unwrap(
                HEAD
                + chance.randbytes(8)
                + bytes((chance.randrange(9), 0, 0, 0))
                + chance.randbytes(chance.randrange(20))
            )
        except RefusedError as error:
            assert error.cause in ("foreign", "list")
