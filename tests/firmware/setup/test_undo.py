"""Undo of a setup: each file as before, with what its owner has changed since."""

from collections.abc import Callable

import pytest

from board.runtime.errors import StorageError
from firmware.setup.kept import RECORD, Kept
from tests.firmware.setup.conftest import (
    CAPTAIN_TXT,
    CMDLINE,
    COMMAND_LINE,
    CONFIG,
    CONFIG_TXT,
    FILTERED,
    Machine,
    lines,
    make,
    mine,
    undo,
)  # fmt: skip


@pytest.mark.parametrize("board", ["pi", "quad", "mine"])
@pytest.mark.parametrize("has_firewall", [False, True])
def test_undo_restores_every_octet(machine: Machine, board: str, has_firewall: bool):
    board = mine(machine) if board == "mine" else board
    before = machine.state()
    make(machine, board, has_firewall=has_firewall)
    assert machine.state() != before
    undo(machine)
    assert machine.state() == before
    assert not (machine.root / RECORD).parent.exists()
    assert undo(machine) == []


def test_setup_made_twice_changes_nothing_the_second_time(machine: Machine):
    before = machine.state()
    make(machine)
    made = machine.state()
    make(machine)
    assert machine.state() == made
    undo(machine)
    assert machine.state() == before


def test_setup_for_another_board_replaces_the_lines_of_the_first(machine: Machine):
    make(machine, mine(machine))
    before = {name: octets for name, octets in machine.state().items() if name != "etc/captain/mine.toml"}
    make(machine, "pi")
    assert lines(machine, "pi") == []
    assert machine.read(CAPTAIN_TXT).splitlines()[1:] == ["dtoverlay=pps-gpio,gpiopin=18"]
    undo(machine)
    assert machine.read(CONFIG_TXT) == CONFIG
    assert machine.read(CMDLINE) == COMMAND_LINE
    assert set(before) - set(machine.state()) >= {CAPTAIN_TXT, RECORD}


def test_undo_keeps_what_the_owner_has_changed_since(machine: Machine):
    make(machine, mine(machine))
    config = machine.write(CONFIG_TXT, machine.read(CONFIG_TXT).replace("audio=on", "audio=off") + "gpu_mem=16\n")
    machine.write(CMDLINE, machine.read(CMDLINE).replace("rootwait", "rootwait quiet"))
    machine.write("etc/default/captain", machine.read("etc/default/captain").replace("OPTIONS=", "OPTIONS=--journal"))
    said = undo(machine)
    assert config.read_text() == CONFIG.replace("audio=on", "audio=off") + "[all]\ngpu_mem=16\n"
    assert machine.read(CMDLINE) == COMMAND_LINE.replace("rootwait", "rootwait quiet")
    assert machine.read("etc/default/captain").endswith("CAPTAIN_BOARD=none\nCAPTAIN_OPTIONS=--journal\n")
    for name in ("boot/firmware/config.txt", "boot/firmware/cmdline.txt", "etc/default/captain"):
        assert f"/{name}: changed since the setup: only its own lines are removed" in said


@pytest.mark.parametrize(
    ("edit", "then"),
    [
        (lambda text: text.replace("include", "gpu_mem=16\ninclude"), "dtparam=audio=on\n[all]\ngpu_mem=16\n"),
        (lambda text: text.replace("\n", "\r\n"), "dtparam=audio=on\r\n"),
        (lambda text: text.replace("audio=on", "audio=off"), "dtparam=audio=off\n"),
        (lambda text: text + "  include  captain.txt\n", "dtparam=audio=on\n"),
    ],
    ids=["a line between", "CRLF", "the line above", "a second include"],
)
def test_undo_of_an_edited_config_txt_leaves_no_line_of_the_setup(
    machine: Machine, edit: Callable[[str], str], then: str
):
    machine.write(CONFIG_TXT, "dtparam=audio=on")
    make(machine)
    config = machine.root / CONFIG_TXT
    config.write_bytes(edit(config.read_text()).encode())
    assert f"/{CONFIG_TXT}: changed since the setup: only its own lines are removed" in undo(machine)
    assert config.read_bytes().decode() == then
    assert not (machine.root / CAPTAIN_TXT).exists()


def test_undo_of_a_line_that_the_owner_extended_fails_and_keeps_the_record(machine: Machine):
    make(machine)
    config = machine.read(CONFIG_TXT)
    machine.write(CONFIG_TXT, config.replace("include captain.txt", "include captain.txt # mine"))
    for _ in range(2):
        assert f"failed: /{CONFIG_TXT}: could not be reverted: include captain.txt # mine is still there" in undo(
            machine
        )
        assert not Kept(machine.root).is_empty
    machine.write(CONFIG_TXT, config)
    assert undo(machine) == [f"/{CONFIG_TXT}: as before"]
    assert machine.read(CONFIG_TXT) == CONFIG


def test_undo_of_a_line_that_the_owner_replaced_keeps_the_owners(machine: Machine):
    make(machine)
    machine.write("etc/default/captain", "CAPTAIN_BOARD=quad\n")
    assert "/etc/default/captain: changed since the setup: has none of its lines" in undo(machine)
    assert machine.read("etc/default/captain") == "CAPTAIN_BOARD=quad\n"


def test_setup_after_a_power_cut_between_record_and_file_keeps_the_file_of_before(machine: Machine):
    board = mine(machine)
    make(machine, board)
    machine.write(CMDLINE, COMMAND_LINE)
    make(machine, board)
    undo(machine)
    assert machine.read(CMDLINE) == COMMAND_LINE


def test_undo_does_not_add_a_console_that_the_owner_added_again(machine: Machine):
    make(machine, mine(machine))
    now = machine.read(CMDLINE).replace("rootwait", "rootwait console=serial0,115200")
    machine.write(CMDLINE, now)
    undo(machine)
    assert machine.read(CMDLINE) == now


@pytest.mark.parametrize("config", [CONFIG, FILTERED])
@pytest.mark.parametrize("later", ["", "gpu_mem=16\n"])
def test_undo_keeps_later_lines_below_all(machine: Machine, config: str, later: str):
    machine.write(CONFIG_TXT, config)
    make(machine)
    machine.write(CONFIG_TXT, machine.read(CONFIG_TXT) + later)
    undo(machine)
    assert machine.read(CONFIG_TXT) == (f"{config}[all]\n{later}" if later else config)


def test_undo_after_a_change_between_two_setups_keeps_that_change(machine: Machine):
    make(machine, "pi")
    machine.write("etc/default/captain", machine.read("etc/default/captain") + "# mine\n")
    make(machine, "quad")
    undo(machine)
    assert machine.read("etc/default/captain").endswith("CAPTAIN_BOARD=none\nCAPTAIN_OPTIONS=\n# mine\n")


def test_undo_after_a_file_was_removed_between_two_setups_removes_it_again(machine: Machine):
    make(machine, "pi")
    (machine.root / "etc/default/captain").unlink()
    make(machine, "quad")
    undo(machine)
    assert not (machine.root / "etc/default/captain").exists()


def test_undo_keeps_own_lines_of_the_owner_in_captain_txt(machine: Machine):
    make(machine)
    machine.write(CAPTAIN_TXT, machine.read(CAPTAIN_TXT) + "gpu_mem=16\n")
    undo(machine)
    assert machine.read(CAPTAIN_TXT) == "gpu_mem=16\n"
    assert machine.read(CONFIG_TXT) == CONFIG


def test_undo_after_all_files_are_gone_makes_none(machine: Machine):
    make(machine)
    for name in (CONFIG_TXT, CAPTAIN_TXT, "etc/default/captain"):
        (machine.root / name).unlink()
    assert f"/{CONFIG_TXT}: is absent: nothing to revert" in undo(machine)
    assert not (machine.root / CONFIG_TXT).exists()
    assert not (machine.root / RECORD).exists()


def test_files_without_an_end_of_line_or_missing_are_restored(machine: Machine):
    machine.write(CONFIG_TXT, "dtparam=audio=on")
    machine.write(CMDLINE, "root=/dev/mmcblk0p2 console=serial0,115200")
    (machine.root / "etc/default/captain").unlink()
    before = machine.state()
    board = mine(machine)
    make(machine, board)
    assert lines(machine, board) == []
    assert machine.read(CONFIG_TXT) == "dtparam=audio=on\n[all]\ninclude captain.txt\n"
    assert machine.read(CMDLINE) == "root=/dev/mmcblk0p2"
    undo(machine)
    (machine.root / "etc/captain/mine.toml").unlink()
    assert machine.state() == before


def test_setup_that_breaks_off_is_reverted_by_undo(machine: Machine):
    before = machine.state()
    machine.fails = "usermod"
    with pytest.raises(Exception, match="usermod"):
        make(machine)
    machine.fails = ""
    machine.said.clear()
    undo(machine)
    assert machine.state() == before
    assert machine.said == []


def test_undo_of_a_command_that_fails_says_so_reverts_the_rest_and_keeps_the_command(machine: Machine):
    before = machine.state()
    make(machine)
    machine.fails = "gpasswd"
    assert any(line.startswith("failed: gpasswd --delete captain i2c") for line in undo(machine))
    assert machine.read(CONFIG_TXT) == CONFIG
    machine.fails = ""
    assert undo(machine) == ["gpasswd --delete captain i2c"]
    assert machine.state() == before


def test_record_that_is_damaged_is_an_error_with_its_path(machine: Machine):
    machine.write(RECORD, "{")
    with pytest.raises(StorageError, match=r"setup\.json: is not a record of a setup"):
        Kept(machine.root)
