"""A restart is asked for while no update is written, and by nothing else."""

import socket
import stat
from pathlib import Path

import pytest

from board.runtime.errors import StationError
from firmware.cli import main
from firmware.update import bundle as update_bundle
from firmware.update import health, rauc, update
from firmware.update.bundle import Box
from firmware.update.folder import Folder, LockedError
from firmware.update.rauc import BusyError
from tests.firmware.update.conftest import OVERLAY, Said
from tests.firmware.update.rauc_service import Service


def test_restart_is_asked_for_by_a_connection(
    service: Service, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch
):
    place = tmp_path / "restart"
    monkeypatch.setattr(update.restart, "__defaults__", (place,))
    assert main(["update", "--restart"]) == 1
    assert "No such file" in said()[1]
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(place))
        listener.listen()
        assert stat.S_ISSOCK(place.stat().st_mode)
        assert main(["update", "--restart"]) == 0
        taken, _ = listener.accept()
        with taken:
            assert taken.recv(1) == b""


class Asked(list[str]):
    """Restarts that were asked for."""


@pytest.fixture
def restarts(monkeypatch: pytest.MonkeyPatch) -> Asked:
    asked = Asked()
    monkeypatch.setattr(update, "restart", lambda: asked.append("restart"))
    return asked


def test_restart_while_the_service_writes_a_slot_is_refused(service: Service, restarts: Asked, said: Said):
    service.is_at("installing")
    assert main(["update", "--restart"]) == 1
    out, err = said()
    assert (restarts, out) == ([], "")
    assert f"{BusyError().message}\n  ({BusyError().hint}" in err
    service.is_at("idle")
    assert main(["update", "--restart"]) == 0
    assert restarts == ["restart"]


def test_restart_while_another_update_has_the_lock_is_refused(
    service: Service, restarts: Asked, tmp_path: Path, said: Said
):
    with Folder(tmp_path / "update").locked():
        assert main(["update", "--restart"]) == 1
        assert main(["update", "--back", "--restart"]) == 1
    assert said()[1].count("captain: the box is not restarted: ") == 1
    assert restarts == []
    assert main(["update", "--restart"]) == 0
    assert restarts == ["restart"]


@pytest.mark.parametrize("words", [["--back", "--restart"], ["FILE", "--restart"]])
def test_restart_is_asked_for_while_no_update_can_begin(
    service: Service, bundle: str, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch, words: list[str]
):
    def restart() -> None:
        with pytest.raises(LockedError), Folder(tmp_path / "update").locked():
            raise AssertionError("another one has the lock")

    monkeypatch.setattr(update, "restart", restart)
    assert main(["update", *(word.replace("FILE", bundle) for word in words)]) == 0
    assert said()[0].endswith("; the next start uses it\nrestarting now\n" if "FILE" in words else "\nrestarting now\n")


def test_restart_that_is_refused_leaves_the_update_installed(
    service: Service, bundle: str, restarts: Asked, said: Said, monkeypatch: pytest.MonkeyPatch
):
    def installed(path: Path, name: str, step: object) -> None:
        service.is_at("installing")  # of somebody who asks the service itself

    monkeypatch.setattr(rauc, "install", installed)
    assert main(["update", bundle, "--restart"]) == 1
    out, err = said()
    assert out.endswith("version 1.2.4 is installed; the next start uses it\n")
    assert BusyError().message in err
    assert restarts == []


@pytest.fixture
def checks(monkeypatch: pytest.MonkeyPatch) -> Asked:
    """Whether the station is well, asked of nobody."""
    asked = Asked()

    def check() -> str:
        asked.append("check")
        return "well"

    monkeypatch.setattr(health, "check", check)
    return asked


@pytest.mark.parametrize("word", ["--restart", "--check"])
def test_machine_that_is_no_box_is_told_before_anything_else(
    restarts: Asked, checks: Asked, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch, word: str
):
    monkeypatch.setattr(update_bundle.box, "__defaults__", (tmp_path / "system.conf", tmp_path / "signer"))
    assert main(["update", word]) == 1
    out, err = said()
    assert out == ""
    assert err.startswith("captain: ")
    assert str(tmp_path / "system.conf") in err
    assert (restarts, checks) == ([], [])


@pytest.mark.parametrize(("word", "done"), [("--restart", (["restart"], [])), ("--check", ([], ["check"]))])
def test_box_whose_slots_are_not_known_is_restarted_and_judged(
    service: Service, restarts: Asked, checks: Asked, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    word: str, done: tuple[list[str], list[str]],
):  # fmt: skip
    def broken() -> Box:
        raise StationError("no two slots")

    monkeypatch.setattr(update_bundle, "box", broken)
    monkeypatch.setattr(update_bundle.demand_box, "__defaults__", (tmp_path,))
    assert main(["update", word]) == 0
    assert (restarts, checks) == done


def test_place_by_which_a_box_is_known_is_that_of_its_judge():
    assert (OVERLAY / update_bundle.IMAGE.relative_to("/") / "judge").exists()


def test_box_whose_folder_or_service_of_updates_fails_is_restarted(service: Service, restarts: Asked, tmp_path: Path):
    (service.folder / "bus").write_text("what nobody understands")
    assert main(["update", "--restart"]) == 0
    (tmp_path / "update/lock").unlink()
    (tmp_path / "update/fetched").rmdir()
    (tmp_path / "update").rmdir()
    assert main(["update", "--restart"]) == 0
    assert restarts == ["restart", "restart"]
