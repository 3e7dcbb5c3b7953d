"""Complete update and its messages, with a double of the service."""

from pathlib import Path

import pytest

from board.runtime.boot_counters import State
from board.runtime.errors import StationError
from firmware import VERSION
from firmware.cli import main
from firmware.update import bundle as update_bundle
from firmware.update import counters, fetch, rauc, verity
from firmware.update.bundle import Bundle
from firmware.update.folder import Folder
from firmware.update.reason import LOG
from tests.firmware.update.conftest import BUNDLE, Said
from tests.firmware.update.rauc_service import BROKEN, BUSY, DENIED, REFUSED, Service

READ, CHECK = update_bundle.read, verity.check


def test_update_shows_what_is_in_it_and_goes_on_line_by_line(service: Service, bundle: str, said: Said):
    assert main(["update", bundle]) == 0
    out, _ = said()
    assert f"version     1.2.4, built b; slot A runs {VERSION}\n" in out
    assert "signed by   O=captain\ngoes into   slot B, in place of version 1.2.3\n" in out
    assert " 64 %  Copying image to rootfs.1\n" in out
    assert out.endswith(
        "version 1.2.4 is installed; the next start uses it; restart the box: captain update --restart\n"
    )
    assert "\r" not in out
    assert "\x1b" not in out
    assert service.asked == ["status --detailed --output-format=json", f"install {bundle}"]


def test_look_at_a_bundle_writes_nothing(service: Service, bundle: str, said: Said):
    assert main(["update", "--look", bundle]) == 0
    assert not any(words.startswith("install") for words in service.asked)


@pytest.mark.parametrize("words", [["-"], ["--look", "-"], ["--back"]])
def test_update_while_the_service_installs_is_refused(
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
    assert rauc.BusyError().message in said()[1]
    assert kept.read_bytes() == b"is read"


def test_look_and_update_leave_a_file_of_a_user_alone(
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


@pytest.mark.parametrize(
    ("words", "meant"),
    [(DENIED, "operator"), (BUSY, rauc.BusyError().message), ("", LOG)],
)
def test_service_that_refuses_is_told(service: Service, bundle: str, said: Said, words: str, meant: str):
    service.installs(words, 1)
    assert main(["update", bundle]) == 1
    assert meant in said()[1]


def test_bundle_of_another_box_is_not_installed(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(update_bundle, "read", lambda path, name: BUNDLE._replace(compatible="captain trixie pi"))
    assert main(["update", bundle]) == 1
    err = said()[1]
    assert "'captain trixie pi'" in err
    assert "'captain trixie quad'" in err
    assert not any(words.startswith("install") for words in service.asked)


def test_update_from_a_slot_on_trial_is_refused(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(counters, "read", lambda: State(("A", "B"), 2, 3, "A"))
    assert main(["update", bundle]) == 1
    assert "slot A is on trial" in said()[1]  # as the update proof has it
    assert not any(words.startswith("install") for words in service.asked)
    assert main(["update", "--look", bundle]) == 0


def test_bundle_that_is_refused_is_removed_and_a_file_of_a_user_stays(
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
    ("words", "name"), [(["-"], "standard input"), (["--look", "-"], "standard input"), (["http://x/y"], "http://x/y")]
)
def test_failure_is_told_of_the_source_that_was_named(
    service: Service, bundle: str, said: Said, monkeypatch: pytest.MonkeyPatch,
    words: list[str], name: str, trouble: str,
):  # fmt: skip
    def fetched(url: str, folder: Folder, *more: object) -> Path:
        folder.bundle.write_bytes(Path(bundle).read_bytes())
        return folder.bundle

    monkeypatch.setattr(fetch, "from_url", fetched)
    match trouble:
        case "signature":
            monkeypatch.setattr(update_bundle, "read", READ)
            service.installs("", 1)
        case "kind":
            other = BUNDLE._replace(compatible="other")
            monkeypatch.setattr(update_bundle, "read", lambda path, name: other._replace(name=name))
        case "contents":
            monkeypatch.setattr(verity, "check", CHECK)
        case "slot":
            service.installs(BROKEN, 1)
    with open(bundle) as file:
        monkeypatch.setattr("sys.stdin", file)
        code = main(["update", *words])
    assert code == (0 if "--look" in words and trouble == "slot" else 3 if trouble == "slot" else 1)
    assert code == 0 or said()[1].startswith(f"captain: {name}: ")


@pytest.mark.parametrize(
    "words",
    [[], ["--status", "x"], ["--back", "x"], ["--look"], ["--status", "--restart"], ["x", "--look", "--restart"]],
)
def test_options_that_do_not_go_together_are_wrong_usage(words: list[str], said: Said):
    assert main(["update", *words]) == 2
    assert "captain update --" in said()[1]


def test_installation_that_was_not_begun_leaves_no_half_written_slot(tmp_path: Path):
    program = tmp_path / "rauc"
    (tmp_path / "said").write_text(REFUSED)
    program.write_text(f"#!/bin/sh\ncat {tmp_path}/said\nexit 1\n")
    program.chmod(0o755)
    with pytest.raises(StationError, match=r"^x: .*: Compatible mismatch") as told:
        rauc.install(Path("x"), "x", lambda percent, what: None, str(program))
    assert not isinstance(told.value, rauc.InstallError)
