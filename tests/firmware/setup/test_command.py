"""captain box setup: what it prints, and its exit status."""

import pytest

from firmware import cli
from firmware.commands import box
from firmware.doctor import setup as doctor
from firmware.doctor.finding import Level
from firmware.setup import setup
from firmware.setup.kept import Kept
from tests.firmware.setup.conftest import Machine

Said = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def here(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(box, "ROOT", machine.root)
    monkeypatch.setattr(box, "Kept", lambda root: Kept(root, machine.run))


def test_setup_prints_what_is_missing_and_changes_nothing(machine: Machine, capsys: Said):
    before = machine.state()
    assert cli.main(["box", "setup", "--board", "pi"]) == 1
    *settings, last = capsys.readouterr().out.splitlines()
    assert "/boot/firmware/captain.txt: dtoverlay=pps-gpio,gpiopin=18 (pulse.gpio)" in settings
    assert last == "missing: 4; to make them: sudo captain box setup --board pi --write"
    assert machine.state() == before


def test_setup_written_then_undone_says_to_reboot(machine: Machine, capsys: Said):
    before = machine.state()
    assert cli.main(["box", "setup", "--board", "pi", "--write"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "made: 4; reboot once: sudo reboot"
    assert cli.main(["box", "setup"]) == 0
    assert capsys.readouterr().out == "no setting is missing\n"
    assert cli.main(["box", "setup", "--undo"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "reverted; reboot once: sudo reboot"
    assert machine.state() == before
    assert cli.main(["box", "setup", "--undo"]) == 0
    assert capsys.readouterr().out == "no settings of captain box setup are made\n"


def test_undo_that_fails_names_the_failure_and_the_remedy(machine: Machine, capsys: Said):
    cli.main(["box", "setup", "--board", "pi", "--write"])
    machine.fails = "gpasswd"
    assert cli.main(["box", "setup", "--undo"]) == 1
    *_, failed, last = capsys.readouterr().out.splitlines()
    assert failed == "failed: gpasswd --delete captain i2c: failed"
    assert last.endswith("or revert the rest by hand: sudo rm /var/lib/captain-box/setup.json")


def test_command_to_make_the_settings_has_all_options(machine: Machine, capsys: Said, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(setup, "HIDDEN", ())  # the board is below /tmp
    board = machine.root.parent / "my board.toml"
    board.write_text('name = "mine"\n')
    cli.main(["box", "setup", "--board", str(board), "--pi", "5", "--firewall"])
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.endswith(f"sudo captain box setup --board '{board}' --pi 5 --firewall --write")


def test_setup_of_another_machines_card_takes_the_named_generation(machine: Machine, capsys: Said):
    machine.write("proc/device-tree/model", "linux,dummy-virt\0")
    cli.main(["box", "setup", "--board", "pi"])
    assert "not a Raspberry Pi, but linux,dummy-virt: no overlays\n" in capsys.readouterr().out
    cli.main(["box", "setup", "--board", "pi", "--pi", "5"])
    said = capsys.readouterr().out
    assert "dtoverlay=pps-gpio" in said
    assert said.endswith("to make them: sudo captain box setup --board pi --pi 5 --write\n")


def test_setup_without_a_board_names_the_option(capsys: Said):
    assert cli.main(["box", "setup"]) == 1
    assert "board none has no devices; --board names another: pi, quad, or a file\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["setup", "DIR"], "setup: takes no folder"),
        (["check"], "check: DIR is missing"),
        (["check", "DIR", "--undo"], "check: has no options of setup"),
        (["setup", "--board", "nope"], "board 'nope' is not known"),
    ],
)
def test_options_that_do_not_fit_are_refused(words: list[str], said: str, capsys: Said):
    assert cli.main(["box", *words]) == 2
    assert said in capsys.readouterr().err


def test_doctor_names_each_missing_setting_with_its_remedy(machine: Machine):
    machine.write("etc/default/captain", "CAPTAIN_BOARD=pi\n")
    found = list(doctor.missing(machine.root))
    assert {one.level for one in found} == {Level.WARNING}
    assert {one.remedy for one in found} == {"sudo captain box setup --write"}
    assert "missing: /boot/firmware/captain.txt: dtoverlay=pps-gpio,gpiopin=18 (pulse.gpio)" in [
        one.text for one in found
    ]


def test_doctor_of_a_machine_that_is_set_up_has_one_line(machine: Machine):
    cli.main(["box", "setup", "--board", "pi", "--write"])
    (found,) = doctor.missing(machine.root)
    assert (found.level, found.text) == (Level.OK, "this machine has all settings for board pi")


def test_doctor_without_captain_box_checks_no_settings(machine: Machine):
    (machine.root / "usr/share/captain/nftables.conf").unlink()
    assert list(doctor.missing(machine.root)) == []


def test_doctor_of_a_pi_without_config_txt_names_the_remedy(machine: Machine):
    machine.write("etc/default/captain", "CAPTAIN_BOARD=pi\n")
    (machine.root / "boot/firmware/config.txt").unlink()
    (found,) = doctor.missing(machine.root)
    assert found.remedy == "mount the boot partition"
