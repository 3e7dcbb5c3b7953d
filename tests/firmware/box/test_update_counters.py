"""The boot counters as the box reads them are what the image and the boot script write."""

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

from board.errors import StationError
from firmware.box import update_counters
from firmware.box.update_counters import Counters
from image import state

states = some.builds(
    state.State,
    some.sampled_from([("A", "B"), ("B", "A")]),
    some.integers(0, 15),
    some.integers(0, 15),
    some.sampled_from(["0", "A", "B"]),
)


def card(path: Path, octets: bytes) -> Path:
    (path / "state").write_bytes(octets)
    found = path / "fw_env.config"
    found.write_text(f"# copies\n{path}/state 0x000000 0x1000\n{path}/state  0x400000  0x1000\n")
    return found


def test_a_new_card_has_all_tries_and_nothing_new(tmp_path: Path):
    found = update_counters.read(card(tmp_path, state.blank()))
    assert found == Counters(("A", "B"), {"A": 3, "B": 3}, "")


@given(first=states, second=states, counter=some.integers(0, 255), is_first_newer=some.booleans())
def test_the_newer_copy_counts_as_it_does_for_the_boot_script(
    first: state.State, second: state.State, counter: int, is_first_newer: bool
):
    numbers = (counter, counter + 1 & 0xFF) if not is_first_newer else (counter + 1 & 0xFF, counter)
    copies = [state.packed(one, number) for one, number in zip((first, second), numbers, strict=True)]
    wanted = state.newest(copies[0].ljust(state.APART, b"\0") + copies[1])
    assert wanted is not None
    found = update_counters.newest(copies)
    assert (found.order, found.left, found.new or "0") == (
        wanted.order,
        {"A": wanted.a_left, "B": wanted.b_left},
        wanted.new,
    )


@given(seed=some.integers(0, 1 << 32))
def test_octets_of_no_copy_are_a_card_that_begins_anew(seed: int):
    octets = random.Random(seed).randbytes(state.SIZE)
    assert update_counters.newest([octets, bytes(4096)]).left == {"A": 3, "B": 3}


def test_who_may_not_read_them_is_told(tmp_path: Path):
    missing = tmp_path / "fw_env.config"
    with pytest.raises(StationError, match="boot counters cannot be read: No such file"):
        update_counters.read(missing)
    missing.write_text("/none/device 0x0 0x1000\n")
    with pytest.raises(StationError, match="boot counters cannot be read: No such file"):
        update_counters.read(missing)
