"""The whole way of an update, and what is said on it, with a service that does as it is told."""

from pathlib import Path

import pytest

from board.errors import StationError
from firmware import VERSION
from firmware.box import update_bundle, update_counters, update_fetch, update_rauc, update_verity
from firmware.box.update_bundle import Bundle
from firmware.box.update_counters import Counters
from firmware.box.update_folder import Folder
from firmware.cli import main
from tests.firmware.box.conftest import BUNDLE, Said
from tests.firmware.box.rauc_service import BROKEN, BUSY, DENIED, REFUSED, Service

READ, CHECK = update_bundle.read, update_verity.check


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
