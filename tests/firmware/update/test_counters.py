"""The boot counters as the box reads them are what the image and the boot script write."""

from pathlib import Path

import pytest

from board.runtime import boot_counters
from board.runtime.boot_counters import State
from board.runtime.errors import StationError
from firmware.update import counters


def card(path: Path, octets: bytes) -> Path:
    (path / "state").write_bytes(octets)
    found = path / "fw_env.config"
    found.write_text(f"# copies\n{path}/state 0x000000 0x1000\n{path}/state  0x400000  0x1000\n")
    return found


def test_a_new_card_has_all_tries_and_nothing_new(tmp_path: Path):
    assert counters.read(card(tmp_path, boot_counters.blank())) == State()


def test_the_newer_copy_is_read_from_its_place(tmp_path: Path):
    newer = State(("B", "A"), 2, 1, "B", "A")
    octets = boot_counters.packed(State(), 7).ljust(boot_counters.APART, b"\0") + boot_counters.packed(newer, 8)
    assert counters.read(card(tmp_path, octets)) == newer


def test_a_card_without_a_whole_copy_begins_anew(tmp_path: Path):
    assert counters.read(card(tmp_path, bytes(boot_counters.APART) + b"\xff" * boot_counters.SIZE)) == State()


def test_who_may_not_read_them_is_told(tmp_path: Path):
    missing = tmp_path / "fw_env.config"
    with pytest.raises(StationError, match="boot counters: cannot be read: No such file"):
        counters.read(missing)
    missing.write_text("/none/device 0x0 0x1000\n")
    with pytest.raises(StationError, match="boot counters: cannot be read: No such file"):
        counters.read(missing)
