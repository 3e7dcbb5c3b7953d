"""Verdict on a slot on trial: the image's script, over counters."""

import os
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from board.runtime import boot_counters
from board.runtime.boot_counters import State
from image import own_files
from tests.said import tells

SCRIPTS = own_files.OVERLAY / "usr/lib/captain-image"
WELL = {"EXIT_CODE": "exited", "EXIT_STATUS": "0", "SERVICE_RESULT": "success"}
FAILED = {"EXIT_CODE": "exited", "EXIT_STATUS": "1", "SERVICE_RESULT": "exit-code"}
HUNG = {"EXIT_CODE": "killed", "EXIT_STATUS": "TERM", "SERVICE_RESULT": "timeout"}
STOPPED = {"EXIT_CODE": "killed", "EXIT_STATUS": "TERM", "SERVICE_RESULT": "success"}


class Box:
    """A slot that runs, and what is done to it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._state = folder / "state"
        self._cmdline = folder / "cmdline"
        (folder / "captain-image").mkdir()
        (folder / "fw.config").write_text(f"{self._state} 0x0 0x1000\n{self._state} 0x400000 0x1000\n")
        for name in ("fw_printenv", "fw_setenv"):
            self._program(name, f'exec /usr/bin/{name} -c {folder}/fw.config "$@"')
        self._program("systemctl", f'echo "$@" >>{folder}/asked')
        self._program("sync", ":")

    def _program(self, name: str, text: str) -> None:
        path = self.folder / "bin" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)

    def run(self, script: str, slot: str, before: State, ended: dict[str, str] | None = None, *words: str) -> State:
        """The counters afterwards."""
        octets = boot_counters.packed(before, 7).ljust(boot_counters.APART, b"\0") + boot_counters.packed(before, 6)
        self._state.write_bytes(octets.ljust(8 << 20, b"\0"))
        self._cmdline.write_text(f"console=x root=PARTUUID=43505401-02 ro {slot and f'rauc.slot={slot}'} quiet\n")
        text = (SCRIPTS / script).read_text()
        for old, new in (("/proc/cmdline", str(self._cmdline)), ("/run/", f"{self.folder}/")):
            text = text.replace(old, new)
        made = self.folder / script
        made.write_text(text)
        environment = {"PATH": f"{self.folder}/bin:{os.environ['PATH']}", **(ended or {})}
        self.ended = subprocess.run(["sh", made, *words], env=environment, capture_output=True, text=True, check=False)
        found = boot_counters.newest(boot_counters.copies_in(self._state.read_bytes()))
        assert found is not None
        return found

    @property
    def is_restarting(self) -> bool:
        path = self.folder / "asked"
        return path.exists() and "reboot" in path.read_text()

    @property
    def judged(self) -> str:
        path = self.folder / "captain-image/judged"
        return path.read_text() if path.exists() else ""

    @property
    def said(self) -> str:
        path = self.folder / "early"
        return path.read_text() if path.exists() else ""

    def delay_counters(self) -> None:
        """They cannot be read before somebody has waited for them: udev has not named their partition yet."""
        read = f'exec /usr/bin/fw_printenv -c {self.folder}/fw.config "$@"'
        self._program("fw_printenv", f"[ -e {self.folder}/waited ] || exit 1\n{read}")
        self._program("sleep", f"touch {self.folder}/waited")


@pytest.fixture
def box(tmp_path: Path) -> Box:
    return Box(tmp_path)


BA = ("B", "A")


def test_a_slot_that_is_well_gets_its_tries_back_and_says_nothing(box: Box):
    assert box.run("judge", "A", State(a_left=2), WELL) == State()
    assert (box.is_restarting, box.said, box.ended.returncode) == (False, "", 0)
    assert box.judged == "well\n"


def test_a_new_slot_that_is_well_is_new_no_more(box: Box):
    assert box.run("judge", "B", State(BA, 3, 2, "B"), WELL) == State(BA, 3, 3)
    assert not box.is_restarting


@pytest.mark.parametrize("ended", [FAILED, HUNG])
def test_slot_on_trial_that_fails_restarts_and_its_tries_stay_used(box: Box, ended: dict[str, str]):
    before = State(BA, 3, 1, "B")
    assert box.run("judge", "B", before, ended) == before
    assert box.is_restarting
    assert tells(box.said, "slot B ", "on trial", "failed")


@pytest.mark.parametrize("ended", [FAILED, HUNG])
@pytest.mark.parametrize("new", ["0", "B"])
@pytest.mark.parametrize("again", ["0", "A"])
def test_slot_that_is_known_good_and_fails_stays_and_is_never_restarted(
    box: Box, ended: dict[str, str], new: str, again: str
):
    # Else three starts with a station that is not well would bring the other slot, which mends nothing.
    assert box.run("judge", "A", State(a_left=0, new=new, again=again), ended) == State(new=new)
    assert not box.is_restarting
    assert tells(box.said, "slot A ", "known good", "stays")
    assert box.judged == "not well\n"


def test_a_check_that_was_stopped_says_nothing_of_the_slot(box: Box):
    before = State(BA, 3, 2, "B")
    assert box.run("judge", "B", before, STOPPED) == before
    assert not box.is_restarting
    assert box.judged == ""


def test_a_new_slot_from_which_nothing_is_heard_is_left_and_an_old_one_is_not(box: Box):
    before = State(BA, 3, 2, "B")
    assert box.run("judge", "B", before, None, "late") == before
    assert box.is_restarting
    (box.folder / "asked").unlink()
    assert box.run("judge", "A", State(a_left=2), None, "late") == State(a_left=2)
    assert not box.is_restarting


def test_the_old_slot_says_that_the_new_one_did_not_get_well(box: Box):
    assert box.run("judge", "A", State(BA, 2, 0, "B"), WELL) == State(BA, 3, 0, "B")
    assert "slot B failed its trial" in box.said


def test_slot_that_lost_power_at_three_starts_is_tried_once_more(box: Box):
    # It has been well before: nobody has updated it.
    assert box.run("judge", "B", State(a_left=0, b_left=2), WELL) == State(a_left=1, b_left=3, again="A")
    assert tells(box.said, "slot A ", "no tries", "known good: ", "next start", "once more")


def test_slot_that_fails_once_more_comes_first_no_more(box: Box):
    assert box.run("judge", "B", State(a_left=0, b_left=2, again="A"), WELL) == State(BA, 0, 3)
    assert tells(box.said, "slot A ", "failed once more: ", "slot B ", "first")


def test_a_slot_that_was_well_when_it_was_tried_once_more_may_be_so_again(box: Box):
    assert box.run("judge", "A", State(a_left=0, again="A"), WELL) == State()
    assert box.said == ""


def test_a_slot_that_is_well_leaves_what_is_said_of_the_other_one(box: Box):
    # The start in which it is to be tried once more was one of the other slot: U-Boot could not read it.
    assert box.run("judge", "B", State(a_left=1, b_left=2, again="A"), WELL) == State(a_left=1, again="A")


def test_the_other_slot_is_not_tried_where_it_is_not_the_first(box: Box):
    assert box.run("judge", "A", State(a_left=2, b_left=0), WELL) == State(a_left=3, b_left=0)


def test_a_system_that_was_started_otherwise_is_not_judged(box: Box):
    assert box.run("judge", "", State(new="A"), FAILED) == State(new="A")
    assert not box.is_restarting


@pytest.mark.parametrize(("slot", "new"), [("A", "B"), ("B", "A")])
def test_before_an_update_the_other_slot_is_named(box: Box, slot: str, new: str):
    assert box.run("before-install", slot, State(), None) == State(new=new)


@pytest.mark.parametrize("slot", ["A", "B"])
def test_a_slot_that_has_not_been_well_yet_does_not_overwrite_the_last_good_one(box: Box, slot: str):
    before = State(BA, 3, 2, slot)
    assert box.run("before-install", slot, before, None) == before
    assert box.ended.returncode == 1
    assert f"slot {slot} is on trial" in box.ended.stderr


def test_a_slot_that_did_not_get_well_may_be_written_again(box: Box):
    assert box.run("before-install", "A", State(BA, 3, 0, "B"), None) == State(BA, 3, 0, "B")
    assert box.ended.returncode == 0


def test_an_update_of_a_system_that_was_started_otherwise_is_refused(box: Box):
    assert box.run("before-install", "", State(), None) == State()
    assert box.ended.returncode == 1


def test_the_service_of_updates_takes_requests_of_root_and_operator_alone():
    tree = ET.parse(own_files.OVERLAY / "etc/dbus-1/system.d/captain-rauc.conf").getroot()
    rules = {
        policy.get("user") or policy.get("context"): [(rule.tag, rule.get("send_interface")) for rule in policy]
        for policy in tree
    }
    assert set(rules) == {"default", "root", "operator"}
    assert rules["default"] == [("deny", None)]
    assert {interface for _, interface in rules["operator"]} == {
        "de.pengutronix.rauc.Installer",
        "org.freedesktop.DBus.Properties",
    }


def test_a_restart_is_asked_for_by_operator_and_root_alone():
    text = (own_files.OVERLAY / "usr/lib/systemd/system/captain-restart.socket").read_text()
    assert "SocketUser=root\nSocketGroup=operator\nSocketMode=0660\n" in text


def test_the_check_of_a_slot_reads_the_configuration_that_its_station_runs_with():
    units = (f"usr/lib/systemd/system/{name}.service" for name in ("captain", "captain-good"))
    station, check = (own_files.read(path, own_files.CARD) for path in units)
    for line in (
        "User=captain",
        "EnvironmentFile=-/run/captain-image/environment",
        "WorkingDirectory=-/data/owner/current",
    ):
        assert f"\n{line}\n" in station
        assert f"\n{line}\n" in check
    assert "--defaults /etc/captain/captain.toml" in station
    assert "CAPTAIN_DEFAULTS=/etc/captain/captain.toml" in check


def test_a_new_slot_is_left_late_though_its_counters_cannot_be_read_at_once(box: Box):
    box.delay_counters()
    box.run("judge", "B", State(("B", "A"), 3, 2, new="B"), None, "late")
    assert box.is_restarting
