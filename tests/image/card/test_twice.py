"""Two builds, compared: what is the same, and which files are not."""

import io
import tarfile
from pathlib import Path

from image.card import twice
from tests.said import tells


def made(folder: Path, word: bytes, mode: int = 0o644, mtime: int = 0) -> Path:
    """A build's folder, with its card. word: in the slot's /etc/x, in the program and in the card."""
    for path in ("foreign/captain/a", "messages/x.so", "program/captain/b", "early/initrd", "parts/boot/u-boot.bin"):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(word if path.startswith("program") else b"same")
        (folder / path).parent.joinpath(".made-from").write_text(str(folder))
    for path in ("userland/root.tar", "parts/root.tar"):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        with tarfile.open(folder / path, "w") as tar:
            head = tarfile.TarInfo("etc/x")
            head.size, head.mode, head.mtime = len(word), mode, mtime
            tar.addfile(head, io.BytesIO(word))
            link = tarfile.TarInfo("etc/link")
            link.type, link.linkname = tarfile.SYMTYPE, "x"
            tar.addfile(link)
    (folder / twice.CARD).write_bytes(word)
    return folder


def differing(one: Path, other: Path) -> dict[str, list[str]]:
    rows = twice.compared(one, one / twice.CARD, other)
    return {row.what: row.differing for row in rows if row.differing}


def test_builds_of_the_same_octets_do_not_differ_whatever_the_dates_in_what_they_pass_on(tmp_path: Path):
    assert differing(made(tmp_path / "one", b"x", mtime=1), made(tmp_path / "two", b"x", mtime=2)) == {}


def test_what_differs_is_named_file_by_file(tmp_path: Path):
    assert differing(made(tmp_path / "one", b"x"), made(tmp_path / "two", b"y")) == {
        "program/captain/**/*": ["captain/b"],
        "userland/root.tar, its files": ["etc/x"],
        "parts/root.tar, its files": ["etc/x"],
        "the card": ["card.img"],
    }


def test_another_mode_is_another_file(tmp_path: Path):
    found = differing(made(tmp_path / "one", b"x", 0o644), made(tmp_path / "two", b"x", 0o600))
    assert found == {"userland/root.tar, its files": ["etc/x"], "parts/root.tar, its files": ["etc/x"]}


def test_file_that_is_left_out_of_the_card_may_differ(tmp_path: Path):
    one, other = made(tmp_path / "one", b"x"), made(tmp_path / "two", b"x")
    with tarfile.open(other / "userland/root.tar", "w"):
        pass  # nothing of it
    (userland,) = (row for row in twice.compared(one, one / twice.CARD, other) if row.differing)
    assert userland.is_left_out
    assert tells(str(userland).splitlines()[0], "DIFFER  userland/root.tar", "2 of 2 files", "left out")


def test_a_row_shows_the_first_of_many_and_says_how_many_there_are():
    assert str(twice.Compared("x", 3, [])) == "same    x: 3 files"
    said = str(twice.Compared("x", 30, [f"f{number}" for number in range(25)]))
    assert said.startswith("DIFFER  x: 25 of 30 files\n          f0\n")
    assert said.endswith("f19\n          and 5 more")
