"""Wrong usage of the commands, reported in words."""

import errno
import fcntl
from pathlib import Path

import pytest

from image import __main__, step
from image.card import build
from tests.said import tells


def said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """The exit code, and what is told, of `python -m image` with these words."""
    monkeypatch.setattr("sys.argv", ["image", *words])
    try:
        code = __main__.main()
    except SystemExit as ended:  # of argparse
        code = int(ended.code or 0)
    return code, capsys.readouterr().err


@pytest.mark.parametrize("verb", ["build", "twice", "release"])
@pytest.mark.parametrize(("place", "why"), [("file", "File exists"), ("file/x", "Not a directory")])
def test_build_folder_that_is_a_file_is_refused_with_the_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    verb: str, place: str, why: str,
):  # fmt: skip
    (tmp_path / "file").touch()
    code, told = said(monkeypatch, capsys, "--to", str(tmp_path / place), verb)
    assert code == 1
    assert tells(told, f"image: {tmp_path / place}: ", "build folder", f": {why}\n", "--to")


def test_build_folder_that_cannot_be_made_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    assert tells(said(monkeypatch, capsys, "--to", "/proc/x", "build")[1], "image: /proc/x: ", "build folder", ": ")


def test_a_date_that_is_none_is_told_before_anything_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "abc")
    assert said(monkeypatch, capsys, "--to", str(tmp_path / "built"), "build")[1].startswith(
        "image: SOURCE_DATE_EPOCH: "
    )
    assert not list(tmp_path.iterdir())


def test_a_link_to_itself_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "loop").symlink_to("loop")
    code, told = said(monkeypatch, capsys, "--to", str(tmp_path / "loop"), "build")
    assert code == 2
    assert f"--to: {tmp_path}/loop: cannot be followed: Symlink loop" in told


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (
            PermissionError(errno.EACCES, "Permission denied", "/keys"),
            "/keys: Permission denied\n  (run it as root, or as the user who",
        ),
        (OSError(errno.ENOSPC, "No space left on device"), "/to: No space left on device\n  (make room, or name"),
        (OSError(errno.EIO, "Input/output error", "/x"), "/x: Input/output error\n  (check the disk)\n"),
    ],
)
def test_what_the_system_refuses_is_told_with_its_place(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: OSError, words: str
):
    def refused(*_: object) -> int:
        raise error

    monkeypatch.setattr(__main__, "_verify", refused)
    code, told = said(monkeypatch, capsys, "--to", "/to", "verify")
    assert code == 1
    assert told.startswith(f"image: {words}")


def test_build_that_is_stopped_ends_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    def stopped(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(__main__, "_build", stopped)
    code, told = said(monkeypatch, capsys, "build")
    assert code == 130
    assert tells(told, "image: stopped; ", "repeats")
    assert told.count("\n") == 1


@pytest.mark.parametrize("words", [["verify"], ["flash", "/dev/none"]])
@pytest.mark.parametrize("is_there", [True, False])
def test_command_that_only_reads_makes_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    words: list[str], is_there: bool,
):  # fmt: skip
    folder = tmp_path / "built"
    if is_there:
        folder.mkdir()
    code, told = said(monkeypatch, capsys, "--to", str(folder), *words)
    assert code == 1
    assert tells(told, f"image: {tmp_path}/", ".img: ", "not there\n", "make image")
    assert list(tmp_path.rglob("*")) == [folder] * is_there


def test_a_card_without_its_key_is_told_and_none_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    folder = tmp_path / "built"
    described = __main__.description.read(build.HERE / "image.toml")
    build.planned(described, folder).image.touch()
    code, told = said(monkeypatch, capsys, "--to", str(folder), "verify")
    assert code == 1
    assert (
        told
        == f"image: {folder}/keys/development.cert.pem: missing\n  (run make image, which makes key, certificate and card)\n"
    )
    assert not folder.exists()


def test_nobody_builds_in_a_folder_while_it_is_looked_at(tmp_path: Path):
    step.Steps(tmp_path).close()
    with step.at_rest(tmp_path), (tmp_path / step.LOCK).open() as other, pytest.raises(BlockingIOError):
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    with step.at_rest(tmp_path / "none"):
        assert not (tmp_path / "none").exists()
