"""Keys and noise: what a burst of octets means."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.console.keys import INTERRUPT, LONGEST, QUIET_S, UNKNOWN, Keys


def typed(*bursts: bytes) -> list[str]:
    """The keys of bursts that come a second after one another."""
    keys, found = Keys(), []
    for second, burst in enumerate(bursts):
        found += keys.receive(burst, float(second))
    return found + keys.expire(float(len(bursts)))


@pytest.mark.parametrize(
    ("octets", "keys"),
    [
        (b"s", ["s"]),
        (b"S", ["s"]),
        (b" ", ["n"]),
        (b"\r", ["r"]),
        (b"\n", ["r"]),
        (b"\r\n", ["r"]),
        (b"\x0c", ["r"]),
        (b"\x03", [INTERRUPT]),
        (b"\x1b[6~", ["n"]),
        (b"\x1b[B", ["n"]),
        (b"\x1bOA", [UNKNOWN]),  # an arrow of a terminal in another mode
        (b"\x1b[5~", ["p"]),
        (b"\x1b[24~", [UNKNOWN]),  # F12
        (b"\x1b", [UNKNOWN]),
        (b"\x08", [UNKNOWN]),
        (b"nnn", ["n", "n", "n"]),  # held down
        (b"\x1b[B\x1b[B", ["n", "n"]),
        (b"s\r", ["s", "r"]),
    ],
)
def test_a_key_is_what_a_terminal_sends_for_it(octets: bytes, keys: list[str]) -> None:
    assert typed(octets) == keys


@pytest.mark.parametrize(
    "octets",
    [b"\x80", b"s\x80", b"\x00", b"sq", b"ls\r", b"reboot\n", b"s" * (LONGEST + 1), b"\xff" * 10_000, b"s\x1b[B"],
)
def test_a_burst_that_no_single_key_makes_is_noise_as_a_whole(octets: bytes) -> None:
    keys = Keys()
    assert keys.receive(octets, 1.0) == []
    assert keys.expire(2.0) == []
    assert keys.noise == len(octets)


def test_octets_count_once_the_line_is_quiet() -> None:
    keys = Keys()
    keys.receive(b"s", 1.0)
    assert keys.deadline() == pytest.approx(1.0 + QUIET_S)
    assert keys.expire(1.0 + QUIET_S / 2) == []
    keys.receive(b"\xfe", 1.0 + QUIET_S / 2)
    assert keys.expire(1.0 + 2 * QUIET_S) == []
    assert keys.noise == 2
    assert keys.deadline() is None


def test_a_flood_keeps_a_few_octets_of_it() -> None:
    keys = Keys()
    for part in range(1000):
        keys.receive(b"s" * 4096, part * QUIET_S / 2)
    assert len(keys._burst) == LONGEST + 1
    assert keys.expire(1000.0) == []
    assert keys.noise == 4_096_000


@given(octets=st.binary(max_size=40), cuts=st.sets(st.integers(0, 40)))
def test_keys_do_not_depend_on_how_a_burst_arrives(octets: bytes, cuts: set[int]) -> None:
    whole, parts, found = Keys(), Keys(), []
    edges = [0, *sorted(cut for cut in cuts if 0 < cut < len(octets)), len(octets)]
    expected = whole.receive(octets, 0.0) + whole.expire(1.0) if octets else []
    for at, end in pairwise(edges):
        if end > at:
            found += parts.receive(octets[at:end], 0.0)
    assert found + parts.expire(1.0) == expected
    assert parts.noise == whole.noise
    # A shell is opened by its key alone.
    assert "s" not in expected or not set(octets) - set(b"sS\r\n\x0c")


def test_what_is_late_belongs_to_the_burst_in_which_it_came() -> None:
    assert typed(b"h", b"q") == ["h", "q"]
