"""Interrupted updates: abandoned, unwatched, or without their service."""

import errno
import io
import json
from pathlib import Path

import pytest

from firmware.cli import main
from firmware.commands.update import ITS_END, UNTOUCHED
from firmware.update import bundle as update_bundle
from firmware.update import rauc, update
from firmware.update.bundle import Bundle
from firmware.update.folder import Folder
from firmware.update.reason import AGAIN, WORN
from tests.firmware.update.conftest import BUNDLE, Said
from tests.firmware.update.rauc_service import BROKEN, BUSY, STATUS, TAKEN, Service

ENDED = "the update service ended"


def test_update_whose_terminal_is_gone_goes_on(
    service: Service, bundle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    class Gone(io.StringIO):
        def flush(self) -> None:
            raise BrokenPipeError

    monkeypatch.setattr("sys.stdout", Gone())
    assert main(["update", bundle]) == 0
    assert service.asked[-1] == f"install {bundle}"
    assert Folder(tmp_path / "update").last()["result"] == "installed"


def test_update_that_breaks_off_without_a_terminal_has_its_exit_code(
    service: Service, bundle: str, monkeypatch: pytest.MonkeyPatch
):
    class Gone(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("sys.stdout", Gone())
    monkeypatch.setattr("sys.stderr", Gone())
    service.installs(BROKEN, 1)
    assert main(["update", bundle]) == 3


@pytest.mark.parametrize(
    ("operation", "last_error", "version", "result"),
    [
        ("installing", "", "1.2.3", "is being installed"),
        ("idle", "", "1.2.3", "installed"),
        ("idle", "GDBus.Error:org.freedesktop.DBus.Error.NoReply", "1.2.3", f"{ENDED} ({AGAIN})"),
        ("idle", "Input/output error", "1.2.3", f"Input/output error ({WORN})"),
        ("idle", "", "1.2.4", "broke off before its end"),
    ],
)
def test_status_of_an_update_that_was_left_is_asked_of_the_service(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch,
    operation: str, last_error: str, version: str, result: str,
):  # fmt: skip
    def interrupted(path: Path, name: str, step: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(rauc, "install", interrupted)
    monkeypatch.setattr(update_bundle, "read", lambda path, name: BUNDLE._replace(version=version))
    assert main(["update", bundle]) == 130
    assert ITS_END in said()[1]
    service.is_at(operation, last_error)
    if operation != "idle":
        service.says("", BUSY, 1)
    assert main(["update", "--status", "--json"]) == 0
    told = json.loads(said()[0])
    assert told["last"]["result"] == result
    assert [slot["name"] for slot in told["slots"]] == ([] if operation != "idle" else ["A", "B"])
    assert main(["update", "--status"]) == 0
    assert said()[0].count("\nB  ") == (operation == "idle")


@pytest.mark.parametrize(("state", "result"), [("ok", "installed"), ("pending", "broke off before its end")])
def test_status_of_an_update_that_was_left_is_of_its_own_slot(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch, state: str, result: str
):
    # Both have a bundle of one version, as those that are built while one is made have.
    def interrupted(path: Path, name: str, step: object) -> None:
        raise KeyboardInterrupt

    status = json.loads(json.dumps(STATUS).replace("1.2.3", BUNDLE.version))
    there, here = (slot for entry in status["slots"] for slot in entry.values())
    here["slot_status"] = there["slot_status"] | {"status": "ok"}
    there["slot_status"]["status"] = state
    service.says(json.dumps(status))
    monkeypatch.setattr(rauc, "install", interrupted)
    assert main(["update", bundle]) == 130
    said()
    assert main(["update", "--status", "--json"]) == 0
    last = json.loads(said()[0])["last"]
    assert (last["slot"], last["result"]) == ("B", result)


def test_update_left_before_a_slot_is_written_says_so(
    service: Service, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch
):
    def interrupted(path: Path, name: str) -> Bundle:
        raise KeyboardInterrupt

    # What is kept of an earlier one, whose end nobody waited for, says nothing of this one.
    Folder(tmp_path / "update").note_result("y", "1.2.3", "B", update.BEGUN)
    monkeypatch.setattr(update_bundle, "read", interrupted)
    assert main(["update", "x"]) == 130
    assert UNTOUCHED in said()[1]


def test_service_that_ends_meanwhile_is_told_now_and_by_status(service: Service, bundle: str, said: Said):
    lines = TAKEN.splitlines()[:8]
    service.installs("\n".join([*lines, "RAUC service disappeared", f"D-Bus error while installing `{bundle}`"]), 1)
    assert main(["update", bundle]) == 3
    assert f"captain: {bundle}: {ENDED}\n  ({AGAIN})\n" in said()[1]
    assert main(["update", "--status", "--json"]) == 0
    assert json.loads(said()[0])["last"]["result"] == f"{bundle}: {ENDED} ({AGAIN})"


def test_update_that_breaks_off_in_a_slot_has_its_exit_code(service: Service, bundle: str, said: Said):
    service.installs(BROKEN, 1)
    assert main(["update", bundle]) == 3
    out, err = said()
    assert '"error"' not in out
    assert "Failed updating slot rootfs.1: failed to write image: Input/output error" in err
    assert main(["update", "--status"]) == 0
    assert "Input/output error" in " ".join(said()[0].split())


def test_update_that_breaks_off_while_writing_gives_a_program_an_error_object(
    service: Service, bundle: str, said: Said
):
    service.installs(BROKEN, 1)
    assert main(["update", bundle, "--json"]) == 3
    found = json.loads(said()[0].splitlines()[-1])
    assert found.keys() == {"error", "hint"}
    assert "Failed updating slot rootfs.1: failed to write image: Input/output error" in found["error"]
