"""The boot counters: two copies, of which one is always whole."""

import random
import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from image.state import APART, SIZE, State, blank, newest, packed, unpacked

states = some.builds(
    State,
    some.sampled_from([("A", "B"), ("B", "A")]),
    some.integers(0, 15),
    some.integers(0, 15),
    some.sampled_from(["0", "A", "B"]),
    some.sampled_from(["0", "A", "B"]),
)


def card(first: bytes, second: bytes) -> bytes:
    return first.ljust(APART, b"\0") + second


def test_a_new_card_tries_a_then_b_three_times_each():
    assert newest(blank()) == State(("A", "B"), 3, 3)
    assert len(blank()) == APART + SIZE


def test_a_copy_has_the_form_of_libubootenv():
    # uboot_env.c: struct uboot_env_redund: crc, flags, data; the checksum is of the data alone.
    octets = packed(State(("B", "A"), 2, 10), 7)
    assert octets[4] == 7
    assert octets[5:].startswith(b"BOOT_ORDER=B A\0BOOT_A_LEFT=2\0BOOT_B_LEFT=a\0BOOT_NEW=0\0BOOT_AGAIN=0\0\0")
    assert int.from_bytes(octets[:4], "little") == zlib.crc32(octets[5:])
    assert len(octets) == SIZE


@given(state=states, counter=some.integers(0, 255))
def test_what_was_written_is_read(state: State, counter: int):
    assert unpacked(packed(state, counter)) == (state, counter)


@pytest.mark.parametrize(
    ("first", "second", "is_first"), [(1, 0, True), (4, 5, False), (0xFF, 0, False), (0, 0xFF, True)]
)
def test_the_newer_copy_counts_also_where_the_counter_begins_again(first: int, second: int, is_first: bool):
    one, other = State(("A", "B"), 1, 1), State(("A", "B"), 2, 2)
    assert newest(card(packed(one, first), packed(other, second))) == (one if is_first else other)


@settings(max_examples=25, deadline=None)
@given(old=states, new=states, cut=some.integers(0, SIZE - 1))
def test_a_write_that_is_cut_at_any_octet_leaves_the_old_state_or_the_new_one(old: State, new: State, cut: int):
    written = packed(new, 2)[:cut] + packed(State(), 0)[cut:]
    assert newest(card(packed(old, 1), written)) in (old, new, State())
    torn = card(packed(old, 1), written)
    if unpacked(written) is None:
        assert newest(torn) == old


@settings(max_examples=20, deadline=None)
@given(seed=some.integers(0, 1 << 32))
def test_octets_of_no_copy_are_no_state(seed: int):
    octets = random.Random(seed).randbytes(SIZE)
    assert unpacked(octets) is None
    assert newest(card(octets, octets)) is None


def test_a_card_that_was_wiped_has_no_state():
    assert newest(card(bytes(SIZE), b"\xff" * SIZE)) is None
