"""The whole way of an update, and what is said on it, with a service that does as it is told."""

import errno
import io
import json
import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from board.errors import StationError
from firmware import VERSION
from firmware.box import (
    update,
    update_bundle,
    update_counters,
    update_fetch,
    update_rauc,
    update_slots,
    update_verity,
)
from firmware.box.update_bundle import Box, Bundle
from firmware.box.update_counters import Counters
from firmware.box.update_folder import Folder, LockedError
from firmware.box.update_verity import Tree
from firmware.cli import main
from tests.firmware.box.rauc_service import BROKEN, BUSY, DENIED, REFUSED, STATUS, TAKEN, Service

BUNDLE = Bundle("x", 5000, "1.2.4", "captain trixie quad", "b", "O=captain", Tree(1, "", ""), 4_000_000)

READ, CHECK = update_bundle.read, update_verity.check

ENDED, AGAIN = (
    "the service of updates has ended meanwhile",
    "captain update writes it anew; journalctl -u rauc tells more",
)
WORN = "captain update writes it anew; if that fails too, the card is worn out"


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    """In a box whose bundles are all well signed."""
    (tmp_path / "bin").mkdir()
    made = Service(tmp_path / "bin")
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    counters = Counters(("B", "A"), {"A": 2, "B": 3}, "B")
    monkeypatch.setattr(update_counters, "read", lambda: counters)
    (tmp_path / "judged").write_text("well\n")
    monkeypatch.setattr(update._judged, "__defaults__", (tmp_path / "judged",))
    monkeypatch.setattr(update_slots, "largest", lambda slot: 1 << 20)
    monkeypatch.setattr(update_bundle, "box", lambda: Box("captain trixie quad", "a release image"))
    monkeypatch.setattr(update_bundle, "read", lambda path, name: BUNDLE)
    monkeypatch.setattr("firmware.box.update_verity.check", lambda path, name, tree, seen: seen(1.0))
    monkeypatch.setattr("firmware.commands.update.signal.signal", lambda number, action: None)
    (tmp_path / "update").mkdir()
    monkeypatch.setattr(update, "Folder", lambda: Folder(tmp_path / "update"))
    monkeypatch.setattr("firmware.commands.update.Folder", lambda: Folder(tmp_path / "update"))
    return made


@pytest.fixture
def bundle(tmp_path: Path) -> str:
    path = tmp_path / "update.raucb"
    path.write_bytes(b"x" * 5000)
    return str(path)


Said = Callable[[], tuple[str, str]]


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Said:
    def said() -> tuple[str, str]:
        found = capsys.readouterr()
        return found.out, found.err

    return said


def test_an_update_shows_what_is_in_it_and_goes_on_line_by_line(service: Service, bundle: str, said: Said):
    assert main(["update", bundle]) == 0
    out, _ = said()
    assert f"version     1.2.4, built b; slot A runs {VERSION}\n" in out
    assert "signed by   O=captain\ngoes into   slot B, in place of version 1.2.3\n" in out
    assert " 64 %  Copying image to rootfs.1\n" in out
    assert out.endswith(
        "version 1.2.4 is installed; the next start takes it: captain update --restart restarts the box\n"
    )
    assert "\r" not in out
    assert "\x1b" not in out
    assert service.asked == ["status --detailed --output-format=json", f"install {bundle}"]


def test_an_update_goes_on_when_whoever_began_it_has_hung_up(
    service: Service, bundle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    class Gone(io.StringIO):
        def flush(self) -> None:
            raise BrokenPipeError

    monkeypatch.setattr("sys.stdout", Gone())
    assert main(["update", bundle]) == 0
    assert service.asked[-1] == f"install {bundle}"
    assert Folder(tmp_path / "update").last()["result"] == "installed"


def test_half_a_slot_is_said_by_the_exit_code_though_both_streams_are_gone(
    service: Service, bundle: str, monkeypatch: pytest.MonkeyPatch
):
    class Gone(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("sys.stdout", Gone())
    monkeypatch.setattr("sys.stderr", Gone())
    service.installs(BROKEN, 1)
    assert main(["update", bundle]) == 3


def test_looking_writes_nothing(service: Service, bundle: str, said: Said):
    assert main(["update", "--look", bundle]) == 0
    assert not any(words.startswith("install") for words in service.asked)
    assert "nothing was written" in said()[0]


@pytest.mark.parametrize("words", [["-"], ["--look", "-"], ["--back"]])
def test_nothing_is_begun_while_the_service_still_installs(
    service: Service, bundle: str, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch, words: list[str]
):
    # Whoever began it has gone, and with it the lock: the bundle is still read.
    kept = tmp_path / "update/fetched/bundle.raucb"
    kept.parent.mkdir()
    kept.write_bytes(b"is read")
    service.is_at("installing")
    with open(bundle) as file:
        monkeypatch.setattr("sys.stdin", file)
        assert main(["update", *words]) == 1
    assert "another update is being installed" in said()[1]
    assert kept.read_bytes() == b"is read"


@pytest.mark.parametrize(
    ("operation", "last_error", "version", "result"),
    [
        ("installing", "", "1.2.3", "is being installed"),
        ("idle", "", "1.2.3", "installed"),
        ("idle", "GDBus.Error:org.freedesktop.DBus.Error.NoReply", "1.2.3", f"{ENDED} ({AGAIN})"),
        ("idle", "Input/output error", "1.2.3", f"Input/output error ({WORN})"),
        ("idle", "", "1.2.4", "broke off before it was whole"),
    ],
)
def test_what_became_of_an_update_that_was_left_with_ctrl_c_is_asked_of_the_service(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch,
    operation: str, last_error: str, version: str, result: str,
):  # fmt: skip
    def interrupted(path: Path, name: str, step: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(update_rauc, "install", interrupted)
    monkeypatch.setattr(update_bundle, "read", lambda path, name: BUNDLE._replace(version=version))
    assert main(["update", bundle]) == 130
    assert "is written to its end" in said()[1]
    service.is_at(operation, last_error)
    if operation != "idle":
        service.says("", BUSY, 1)
    assert main(["update", "--status", "--json"]) == 0
    told = json.loads(said()[0])
    assert told["last"]["result"] == result
    assert [slot["name"] for slot in told["slots"]] == ([] if operation != "idle" else ["A", "B"])
    assert main(["update", "--status"]) == 0
    assert ("are told once it is done" in said()[0]) is (operation != "idle")


@pytest.mark.parametrize(("state", "result"), [("ok", "installed"), ("pending", "broke off before it was whole")])
def test_what_became_of_it_is_told_of_the_slot_that_it_goes_into(
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
    monkeypatch.setattr(update_rauc, "install", interrupted)
    assert main(["update", bundle]) == 130
    said()
    assert main(["update", "--status", "--json"]) == 0
    last = json.loads(said()[0])["last"]
    assert (last["slot"], last["result"]) == ("B", result)


def test_ctrl_c_before_anything_is_written_says_so(
    service: Service, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch
):
    def interrupted(path: Path, name: str) -> Bundle:
        raise KeyboardInterrupt

    # What is kept of an earlier one, whose end nobody waited for, says nothing of this one.
    Folder(tmp_path / "update").tell("y", "1.2.3", "B", update.BEGUN)
    monkeypatch.setattr(update_bundle, "read", interrupted)
    assert main(["update", "x"]) == 130
    assert "no slot was touched" in said()[1]


def test_looking_keeps_nothing_and_touches_no_file_of_a_user(
    service: Service, bundle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    own = tmp_path / "update/bundle.raucb"
    own.write_bytes(b"of somebody who has copied it here")
    for words in (["--look", "-"], ["-"], ["--look", str(own)], [str(own)]):
        with open(bundle) as file:
            monkeypatch.setattr("sys.stdin", file)
            assert main(["update", *words]) == 0
    assert own.read_bytes() == b"of somebody who has copied it here"
    assert list((tmp_path / "update").rglob("*.raucb")) == [own]


def test_a_service_that_ends_meanwhile_is_told_in_words_now_and_later(service: Service, bundle: str, said: Said):
    lines = TAKEN.splitlines()[:8]
    service.installs("\n".join([*lines, "RAUC service disappeared", f"D-Bus error while installing `{bundle}`"]), 1)
    assert main(["update", bundle]) == 3
    assert f"captain: {bundle}: {ENDED}\n  ({AGAIN})\n" in said()[1]
    assert main(["update", "--status", "--json"]) == 0
    assert json.loads(said()[0])["last"]["result"] == f"{bundle}: {ENDED} ({AGAIN})"


@pytest.mark.parametrize("words", [["--status"], ["--back"]])
def test_a_service_that_does_not_start_is_told_in_words(service: Service, said: Said, words: list[str]):
    error = "GDBus.Error:org.freedesktop.DBus.Error.ServiceUnknown: The name was not provided by any .service files"
    service.says("", f"rauc-Message: 00:40:09.186: rauc status: error creating proxy: {error}", 1)
    assert main(["update", *words]) == 1
    assert said()[1] == "captain: rauc: the service of updates does not start\n  (journalctl -u rauc tells more)\n"


def test_what_breaks_off_while_it_is_written_has_an_exit_code_of_its_own(service: Service, bundle: str, said: Said):
    service.installs(BROKEN, 1)
    assert main(["update", bundle]) == 3
    err = said()[1]
    assert "Failed updating slot rootfs.1: failed to write image: Input/output error" in err
    assert "this one stays in use" in err
    assert main(["update", "--status"]) == 0
    assert "Input/output error" in " ".join(said()[0].split())


@pytest.mark.parametrize(
    ("words", "meant"),
    [(DENIED, "this user may not update the box"), (BUSY, "another update is being installed"), ("", "no reason")],
)
def test_a_service_that_refuses_is_told(service: Service, bundle: str, said: Said, words: str, meant: str):
    service.installs(words, 1)
    assert main(["update", bundle]) == 1
    assert meant in said()[1]


def test_a_bundle_of_another_box_is_not_installed(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(update_bundle, "read", lambda path, name: BUNDLE._replace(compatible="captain trixie pi"))
    assert main(["update", bundle]) == 1
    assert "'captain trixie pi', and this box is 'captain trixie quad'" in said()[1]
    assert not any(words.startswith("install") for words in service.asked)


def test_a_slot_that_has_not_been_well_yet_takes_no_update(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(update_counters, "read", lambda: Counters(("A", "B"), {"A": 2, "B": 3}, "A"))
    assert main(["update", bundle]) == 1
    assert "slot A was just updated and has not been well yet" in said()[1]
    assert not any(words.startswith("install") for words in service.asked)
    assert main(["update", "--look", bundle]) == 0


def test_what_was_fetched_and_refused_is_removed_and_a_file_of_a_user_stays(
    service: Service, bundle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def refuse(path: Path, name: str) -> Bundle:
        raise StationError(f"{name}: its signature does not fit")

    monkeypatch.setattr(update_bundle, "read", refuse)
    with open(bundle) as file:
        monkeypatch.setattr("sys.stdin", file)
        assert main(["update", "-"]) == 1
    assert [path.name for path in sorted((tmp_path / "update").iterdir())] == ["fetched", "last.json", "lock"]
    assert list((tmp_path / "update/fetched").iterdir()) == []
    assert main(["update", bundle]) == 1
    assert Path(bundle).exists()


@pytest.mark.parametrize("trouble", ["signature", "kind", "contents", "slot"])
@pytest.mark.parametrize(
    ("words", "name"), [(["-"], "the input"), (["--look", "-"], "the input"), (["http://x/y"], "http://x/y")]
)
def test_what_is_wrong_is_told_of_what_was_named_and_not_of_where_it_lies(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch,
    words: list[str], name: str, trouble: str,
):  # fmt: skip
    def fetched(url: str, folder: Folder, *more: object) -> Path:
        folder.bundle.write_bytes(Path(bundle).read_bytes())
        return folder.bundle

    monkeypatch.setattr(update_fetch, "from_url", fetched)
    match trouble:
        case "signature":
            monkeypatch.setattr(update_bundle, "read", READ)
            service.installs("", 1)
        case "kind":
            other = BUNDLE._replace(compatible="other")
            monkeypatch.setattr(update_bundle, "read", lambda path, name: other._replace(name=name))
        case "contents":
            monkeypatch.setattr(update_verity, "check", CHECK)
        case "slot":
            service.installs(BROKEN, 1)
    with open(bundle) as file:
        monkeypatch.setattr("sys.stdin", file)
        code = main(["update", *words])
    assert code == (0 if "--look" in words and trouble == "slot" else 3 if trouble == "slot" else 1)
    assert code == 0 or said()[1].startswith(f"captain: {name}: ")


def test_both_slots_with_what_is_in_them(service: Service, said: Said):
    assert main(["update", "--status"]) == 0
    lines = said()[0].splitlines()
    assert lines[0] == "slots"
    assert lines[2].split(maxsplit=5) == ["A", "runs", VERSION, "-", "2", "well at this start"]
    assert lines[3].startswith("B           next  1.2.3    2026-11-22 20:01")
    assert lines[3].endswith("3  was updated, and has to show that it is well")
    assert lines[4].strip() == "this is a release image"
    assert lines[5].strip() == "no update was tried yet, as far as is kept"


def test_the_status_is_one_object_for_programs(service: Service, said: Said):
    assert main(["update", "--status", "--json"]) == 0
    told = json.loads(said()[0])
    assert [(slot["name"], slot["is_booted"], slot["left"], slot["is_new"]) for slot in told["slots"]] == [
        ("A", True, 2, False),
        ("B", False, 3, True),
    ]


def test_programs_are_told_of_slots_what_people_are(service: Service, said: Said):
    # A fresh card: nothing was installed into either slot.
    status = json.loads(json.dumps(STATUS))
    for entry in status["slots"]:
        for slot in entry.values():
            slot.pop("slot_status", None)
    service.says(json.dumps(status))
    assert main(["update", "--status", "--json"]) == 0
    told = json.loads(said()[0])["slots"]
    assert [(slot["version"], slot["state"]) for slot in told] == [
        (VERSION, "as written"),
        ("as written", "as written"),
    ]
    assert main(["update", "--status"]) == 0
    lines = said()[0].splitlines()[2:4]
    assert all(slot["version"] in line and slot["words"] in line for slot, line in zip(told, lines, strict=True))


def test_the_version_of_a_slot_is_what_was_installed_into_it(service: Service, said: Said):
    service.says(json.dumps(STATUS).replace("inactive", "x").replace("booted", "inactive").replace('"x"', '"booted"'))
    assert main(["update", "--status", "--json"]) == 0
    assert [slot["version"] for slot in json.loads(said()[0])["slots"]] == ["as written", "1.2.3"]


def test_who_may_not_read_the_counters_sees_the_rest(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    def refuse() -> Counters:
        raise StationError("no")

    monkeypatch.setattr(update_counters, "read", refuse)
    assert main(["update", "--status"]) == 0
    assert said()[0].splitlines()[2].split(maxsplit=5) == ["A", "runs", VERSION, "-", "?", "well at this start"]


def test_back_has_the_other_slot_be_the_next_one(service: Service, said: Said):
    assert main(["update", "--back"]) == 0
    assert service.asked[-1] == "status mark-active rootfs.1"
    assert said()[0].startswith("the next start takes slot B, version 1.2.3: ")


@pytest.mark.parametrize("state", ["failed", "pending"])
def test_back_to_a_slot_that_was_not_written_whole_is_refused(service: Service, said: Said, state: str):
    service.says(json.dumps(STATUS).replace('"status": "ok"', f'"status": "{state}"'))
    assert main(["update", "--back"]) == 1
    assert "slot B was not written whole" in said()[1]


def test_back_to_a_slot_that_did_not_get_well_is_refused(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(update_counters, "read", lambda: Counters(("B", "A"), {"A": 3, "B": 0}, "B"))
    assert main(["update", "--back"]) == 1
    assert "slot B was updated and did not get well" in said()[1]


@pytest.mark.parametrize(
    ("status", "meant"),
    [
        ("", "is not understood"),
        ("{}", "has not the form of RAUC 1.13"),
        ('{"slots": []}', "knows 0 slots, and not two"),
        ('{"slots": [{"a": 1}]}', "has not the form"),
    ],
)
def test_a_service_of_another_form_is_told(service: Service, said: Said, status: str, meant: str):
    service.says(status)
    assert main(["update", "--status"]) == 1
    assert meant in said()[1]


def test_a_restart_is_asked_for_by_a_connection_and_by_nothing_else(
    service: Service, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch
):
    import socket

    place = tmp_path / "restart"
    monkeypatch.setattr(update.restart, "__defaults__", (place,))
    assert main(["update", "--restart"]) == 1
    assert "cannot be asked to restart: No such file" in said()[1]
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


def test_no_restart_is_asked_for_while_the_service_writes_a_slot(service: Service, restarts: Asked, said: Said):
    service.is_at("installing")
    assert main(["update", "--restart"]) == 1
    out, err = said()
    assert (restarts, out) == ([], "")
    assert "captain: the box is not restarted: another update is being installed\n  (captain update --status" in err
    service.is_at("idle")
    assert main(["update", "--restart"]) == 0
    assert restarts == ["restart"]


def test_no_restart_is_asked_for_while_another_update_has_the_lock(
    service: Service, restarts: Asked, tmp_path: Path, said: Said
):
    with Folder(tmp_path / "update").locked():
        assert main(["update", "--restart"]) == 1
        assert main(["update", "--back", "--restart"]) == 1
    assert "the box is not restarted: another update is running\n  (wait for it" in said()[1]
    assert restarts == []
    assert main(["update", "--restart"]) == 0
    assert restarts == ["restart"]


@pytest.mark.parametrize("words", [["--back", "--restart"], ["FILE", "--restart"]])
def test_no_update_begins_between_the_last_word_and_the_restart(
    service: Service, bundle: str, tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch, words: list[str]
):
    def restart() -> None:
        with pytest.raises(LockedError), Folder(tmp_path / "update").locked():
            raise AssertionError("another one has the lock")

    monkeypatch.setattr(update, "restart", restart)
    assert main(["update", *(word.replace("FILE", bundle) for word in words)]) == 0
    assert said()[0].endswith(
        "; the next start takes it\nrestarting now\n" if "FILE" in words else "\nrestarting now\n"
    )


def test_what_was_installed_is_told_though_the_restart_is_refused(
    service: Service, bundle: str, restarts: Asked, said: Said, monkeypatch: pytest.MonkeyPatch
):
    def installed(path: Path, name: str, step: object) -> None:
        service.is_at("installing")  # of somebody who asks the service itself

    monkeypatch.setattr(update_rauc, "install", installed)
    assert main(["update", bundle, "--restart"]) == 1
    out, err = said()
    assert out.endswith("version 1.2.4 is installed; the next start takes it\n")
    assert "the box is not restarted" in err
    assert restarts == []


def test_a_box_whose_folder_or_service_of_updates_fails_can_be_restarted(
    service: Service, restarts: Asked, tmp_path: Path
):
    (service.folder / "bus").write_text("what nobody understands")
    assert main(["update", "--restart"]) == 0
    (tmp_path / "update/lock").unlink()
    (tmp_path / "update/fetched").rmdir()
    (tmp_path / "update").rmdir()
    assert main(["update", "--restart"]) == 0
    assert restarts == ["restart", "restart"]


@pytest.mark.parametrize(
    "words",
    [[], ["--status", "x"], ["--back", "x"], ["--look"], ["--status", "--restart"], ["x", "--look", "--restart"]],
)
def test_what_does_not_go_together_is_wrong_usage(words: list[str], said: Said):
    assert main(["update", *words]) == 2
    assert "captain update --" in said()[1]


def test_an_installation_that_was_not_begun_is_no_half_written_slot(tmp_path: Path):
    program = tmp_path / "rauc"
    (tmp_path / "said").write_text(REFUSED)
    program.write_text(f"#!/bin/sh\ncat {tmp_path}/said\nexit 1\n")
    program.chmod(0o755)
    with pytest.raises(StationError, match="was not installed: Compatible mismatch") as told:
        update_rauc.install(Path("x"), "x", lambda percent, what: None, str(program))
    assert not isinstance(told.value, update_rauc.InstallError)
