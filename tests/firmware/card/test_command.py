"""captain box: on a laptop before the card is used, and in the box at its start."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from firmware import cli
from firmware.commands import box
from tests.firmware.card.conftest import KEY, OVERLAY, Files, write

GOOD: Files = {"captain.toml": '[station]\nname = "rsu-7"\n', "authorized_keys": KEY}
BAD: Files = {"captain.toml": "[statoin]\n", "authorized_keys": f"{KEY}\n{KEY[:40]}\n"}
Said = pytest.CaptureFixture[str]


def apply(card: Path, owner: Path, key: str) -> int:
    words = ["--owner", str(owner), "--board", "none", "--defaults", str(OVERLAY / "etc/captain/captain.toml")]
    return cli.main(["box", "apply", str(card), "--key", key, *words])


def looked(owner: Path) -> list[str]:
    return (owner / "looked").read_text().splitlines()


@pytest.mark.parametrize(
    ("files", "code", "lines"),
    [
        (GOOD, 0, ["the box will take it: authorized_keys, captain.toml; 1 ssh key"]),
        ({"authorized_keys": f"{KEY}\n{KEY}\nno-pty {KEY} again\n"}, 0, ["the box will take it: authorized_keys; 1 ssh key"]),
        ({}, 0, ["note   authorized_keys", "the box will take it: no files; 0 ssh keys"]),
        (
            BAD, 1,
            ["WRONG  authorized_keys:2", "WRONG  captain.toml:1", "the box will NOT take it: authorized_keys, captain.toml; 1 ssh key"],
        ),
    ],
)  # fmt: skip
def test_check_of_a_card_gives_a_line_a_note_and_a_status_for_scripts(
    tmp_path: Path, capsys: Said, files: Files, code: int, lines: list[str]
):
    assert cli.main(["box", "check", str(write(tmp_path, files))]) == code
    *notes, last = capsys.readouterr().out.splitlines()
    assert [*(note.partition(": ")[0] for note in notes), last] == lines
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)


@pytest.mark.parametrize(
    ("words", "code", "values"),
    [
        (["check", "CARD/none"], 1, ["CARD/none: No such file or directory", "  ("]),
        (["check", "CARD", "--board", "nope"], 2, ["nope"]),
        (["check", "CARD", "--board", "mine.toml"], 2, ["mine.toml"]),
        (["apply", "CARD"], 2, ["captain box check DIR"]),
        (["apply", "CARD", "--key", "x"], 2, ["captain box check DIR"]),
    ],
)
def test_command_that_cannot_be_done_is_told_once(
    tmp_path: Path, capsys: Said, words: list[str], code: int, values: list[str]
):
    card = str(write(tmp_path / "card", GOOD))
    assert cli.main(["box", *(word.replace("CARD", card) for word in words)]) == code
    said = capsys.readouterr()
    assert (said.out, said.err.count("captain: ")) == ("", 1)
    assert [said.err.count(value.replace("CARD", card)) for value in values] == [1] * len(values)


def test_folder_without_a_name_is_wrong_usage(capsys: Said):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["box", "check", ""])
    assert '""' in capsys.readouterr().err


def test_board_by_its_path_is_looked_for_where_the_command_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write(tmp_path, {"mine.toml": 'name = "mine"\n'})
    monkeypatch.chdir(tmp_path)
    assert cli.main(["box", "check", str(write(tmp_path / "card", GOOD)), "--board", "mine.toml"]) == 0


def test_sound_set_is_put_in_force_and_what_was_found_is_kept(tmp_path: Path):
    card, owner = write(tmp_path / "card", GOOD), tmp_path / "owner"
    assert apply(card, owner, "11112222") == 0
    assert os.readlink(owner / "current") == "11112222"
    assert looked(owner) == [
        "11112222",
        "0",
        "the owner's files are in force: authorized_keys, captain.toml; 1 ssh key",
    ]
    environment = (owner / "current/made/run/captain-image/environment").read_text()
    assert environment == "CAPTAIN_CONFIG=/data/owner/current/captain.toml\n"


def test_first_set_with_mistakes_gives_its_sound_keys_and_nothing_else(tmp_path: Path):
    card, owner = write(tmp_path / "card", BAD), tmp_path / "owner"
    assert apply(card, owner, "11112222") == 0
    assert not (owner / "current").exists()
    assert (owner / "spare/authorized_keys").read_text() == f"{KEY}\n"
    said = "the owner's files are REJECTED, for 2 mistakes; the box runs with its defaults and the valid ssh keys: 1"
    assert looked(owner)[1:3] == ["2", said]
    assert [line.partition(": ")[0] for line in looked(owner)[3:]] == ["authorized_keys:2", "captain.toml:1"]


def test_later_set_with_mistakes_leaves_the_one_before_in_force(tmp_path: Path):
    owner = tmp_path / "owner"
    apply(write(tmp_path / "good", GOOD), owner, "11112222")
    apply(write(tmp_path / "bad", {"captain.toml": "[statoin]\n", "old.toml": ""}), owner, "33334444")
    assert os.readlink(owner / "current") == "11112222"
    assert (owner / "current/authorized_keys").read_text() == f"{KEY}\n"
    assert looked(owner)[0] == "33334444"
    assert looked(owner)[2].startswith(
        "the owner's files are REJECTED, for 1 mistake; the last accepted set stays in force"
    )
    # mistakes come first
    assert [line.partition(": ")[0] for line in looked(owner)[3:]] == ["captain.toml:1", "old.toml", "authorized_keys"]
    assert not (owner / "spare").exists()


def test_set_of_which_everything_was_taken_away_is_a_set(tmp_path: Path):
    owner = tmp_path / "owner"
    apply(write(tmp_path / "good", GOOD), owner, "11112222")
    apply(write(tmp_path / "empty", {"x": ""}), owner, "33334444")
    assert (owner / "current/authorized_keys").read_text() == ""
    assert looked(owner)[2] == "the owner's files are in force: no files; 0 ssh keys"


def test_name_that_is_not_utf_8_is_told_and_kept_like_any_other(tmp_path: Path, capsys: Said):
    card, owner = write(tmp_path / "card", GOOD), tmp_path / "owner"
    (card / os.fsdecode(b"caf\xe9.pem")).write_text("")
    assert apply(card, owner, "11112222") == 0
    assert looked(owner)[3].startswith("caf\\udce9.pem: ")


def test_data_partition_that_takes_nothing_is_told(tmp_path: Path, capsys: Said):
    (tmp_path / "owner").write_text("")
    assert apply(write(tmp_path / "card", GOOD), tmp_path / "owner", "11112222") == 1
    assert "captain: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("place", "code", "said"), [("pipe", 141, ""), ("/dev/full", 1, "cannot write: No space left")]
)
def test_check_whose_output_is_closed_or_full_blames_no_card(tmp_path: Path, place: str, code: int, said: str):
    # More than a buffer of 8 KiB, wherever the card lies: written before the end.
    card = write(tmp_path, {"box.toml": "".join(f"key{number:0200} = 1\n" for number in range(60))})
    if place == "pipe":
        reader, out = os.pipe()
        os.close(reader)
    else:
        out = os.open(place, os.O_WRONLY)
    command = [sys.executable, "-m", "firmware", "box", "check", str(card)]
    ended = subprocess.run(command, stdout=out, stderr=subprocess.PIPE, text=True, check=False)
    os.close(out)
    assert ended.returncode == code
    assert said in ended.stderr
    assert str(card) not in ended.stderr


def test_check_without_room_for_its_copy_names_tmpdir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(box, "verdict", full)
    card = write(tmp_path, GOOD)
    assert cli.main(["box", "check", str(card)]) == 1
    error = capsys.readouterr().err
    assert "No space left on device" in error
    assert "TMPDIR" in error
    assert str(card) not in error
