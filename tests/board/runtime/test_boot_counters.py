"""The boot counters: two copies, of which one is always whole."""

import random
import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from board.runtime.boot_counters import APART, SIZE, State, blank, copies_in, newest, packed, unpacked

states = some.builds(
    State,
    some.sampled_from([("A", "B"), ("B", "A")]),
    some.integers(0, 15),
    some.integers(0, 15),
    some.sampled_from(["0", "A", "B"]),
    some.sampled_from(["0", "A", "B"]),
)


def test_a_new_card_tries_a_then_b_three_times_each():
    assert newest(copies_in(blank())) == State(("A", "B"), 3, 3)
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
    assert newest([packed(one, first), packed(other, second)]) == (one if is_first else other)


@settings(max_examples=25, deadline=None)
@given(old=states, new=states, cut=some.integers(0, SIZE - 1))
def test_a_write_that_is_cut_at_any_octet_leaves_the_old_state_or_the_new_one(old: State, new: State, cut: int):
    written = packed(new, 2)[:cut] + packed(State(), 0)[cut:]
    found = newest([packed(old, 1), written])
    assert found in (old, new, State())
    if unpacked(written) is None:
        assert found == old


@settings(max_examples=20, deadline=None)
@given(seed=some.integers(0, 1 << 32))
def test_octets_of_no_copy_are_no_state(seed: int):
    octets = random.Random(seed).randbytes(SIZE)
    assert unpacked(octets) is None
    assert newest([octets, octets]) is None


def test_a_card_that_was_wiped_has_no_state():
    assert newest([bytes(SIZE), b"\xff" * SIZE, b""]) is None


@pytest.mark.parametrize(
    ("text", "state"),
    [
        (b"", State()),
        (b"BOOT_ORDER=\0BOOT_A_LEFT=\0BOOT_NEW=\0", State()),
        (b"BOOT_A_LEFT=x\0BOOT_B_LEFT=a\0OTHER=1\0", State(a_left=0, b_left=10)),
    ],
)
def test_a_copy_that_another_program_wrote_is_read_as_the_boot_script_does(text: bytes, state: State):
    text = text.ljust(SIZE - 5, b"\0")
    assert unpacked(zlib.crc32(text).to_bytes(4, "little") + b"\7" + text) == (state, 7)
