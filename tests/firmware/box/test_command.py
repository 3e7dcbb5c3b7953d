"""captain box: on a laptop before the card is used, and in the box at its start."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from firmware import cli
from firmware.commands import box
from tests.firmware.box.conftest import KEY, OVERLAY, Files, write

GOOD: Files = {"captain.toml": '[station]\nname = "rsu-7"\n', "authorized_keys": KEY}
BAD: Files = {"captain.toml": "[statoin]\n", "authorized_keys": f"{KEY}\nssh-ed25519 x\n"}
Said = pytest.CaptureFixture[str]


def apply(card: Path, owner: Path, key: str) -> int:
    words = ["--owner", str(owner), "--board", "none", "--defaults", str(OVERLAY / "etc/captain/captain.toml")]
    return cli.main(["box", "apply", str(card), "--key", key, *words])


def looked(owner: Path) -> list[str]:
    return (owner / "looked").read_text().splitlines()


def test_a_sound_card_is_told_to_be_one(tmp_path: Path, capsys: Said):
    assert cli.main(["box", "check", str(write(tmp_path, GOOD))]) == 0
    assert capsys.readouterr().out == "the box will take it: authorized_keys, captain.toml; 1 ssh key\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(GOOD)


def test_a_card_with_a_mistake_is_refused_with_a_status_for_scripts(tmp_path: Path, capsys: Said):
    assert cli.main(["box", "check", str(write(tmp_path, BAD))]) == 1
    assert capsys.readouterr().out == (
        'WRONG  authorized_keys:2: the key "x" is not base64; copy the whole line once more, without breaks\n'
        "WRONG  captain.toml:1: statoin: is not a known key; did you mean station?\n"
        "the box will NOT take it: authorized_keys, captain.toml; 1 ssh key\n"
    )


def test_a_folder_that_is_not_there_is_told(tmp_path: Path, capsys: Said):
    assert cli.main(["box", "check", str(tmp_path / "none")]) == 1
    assert "none: No such file or directory\n  (name the folder" in capsys.readouterr().err


def test_an_empty_name_is_no_folder(capsys: Said):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["box", "check", ""])
    assert "is no name of a folder" in capsys.readouterr().err


@pytest.mark.parametrize("board", ["nope", "mine.toml"])
def test_a_board_that_is_none_is_told_once(tmp_path: Path, capsys: Said, board: str):
    assert cli.main(["box", "check", str(write(tmp_path, GOOD)), "--board", board]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("captain: ")
    assert said.err.count(board) == 1


def test_a_board_is_looked_for_where_the_command_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write(tmp_path, {"mine.toml": 'name = "mine"\n'})
    monkeypatch.chdir(tmp_path)
    assert cli.main(["box", "check", str(write(tmp_path / "card", GOOD)), "--board", "mine.toml"]) == 0


def test_a_key_that_stands_twice_is_one(tmp_path: Path, capsys: Said):
    card = write(tmp_path, {"authorized_keys": f"{KEY}\n{KEY}\nno-pty {KEY} again\n"})
    assert cli.main(["box", "check", str(card)]) == 0
    assert capsys.readouterr().out.endswith("authorized_keys; 1 ssh key\n")


def test_apply_is_for_the_box_itself(tmp_path: Path, capsys: Said):
    assert cli.main(["box", "apply", str(tmp_path)]) == 2
    assert "`captain box check DIR`" in capsys.readouterr().err


def test_a_set_is_put_in_force_and_what_was_found_is_kept(tmp_path: Path):
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


def test_a_first_set_with_mistakes_gives_its_sound_keys_and_nothing_else(tmp_path: Path):
    card, owner = write(tmp_path / "card", BAD), tmp_path / "owner"
    assert apply(card, owner, "11112222") == 0
    assert not (owner / "current").exists()
    assert (owner / "spare/authorized_keys").read_text() == f"{KEY}\n"
    assert looked(owner)[1:] == [
        "2",
        "the owner's files are NOT taken, for 2 mistakes; the box runs as it was made, with the sound ssh keys of them: 1",
        'authorized_keys:2: the key "x" is not base64; copy the whole line once more, without breaks',
        "captain.toml:1: statoin: is not a known key; did you mean station?",
    ]


def test_the_set_of_before_stays_in_force_when_a_later_one_has_mistakes(tmp_path: Path):
    owner = tmp_path / "owner"
    apply(write(tmp_path / "good", GOOD), owner, "11112222")
    apply(write(tmp_path / "bad", {**BAD, "authorized_keys": ""}), owner, "33334444")
    assert os.readlink(owner / "current") == "11112222"
    assert (owner / "current/authorized_keys").read_text() == f"{KEY}\n"
    assert looked(owner)[0] == "33334444"
    assert "those of before stay in force, their ssh keys too" in looked(owner)[2]
    assert not (owner / "spare").exists()


def test_a_set_of_which_everything_was_taken_away_is_a_set(tmp_path: Path):
    owner = tmp_path / "owner"
    apply(write(tmp_path / "good", GOOD), owner, "11112222")
    (tmp_path / "empty").mkdir()
    apply(tmp_path / "empty", owner, "33334444")
    assert (owner / "current/authorized_keys").read_text() == ""
    assert looked(owner)[2] == "the owner's files are in force: no files; 0 ssh keys"


def test_a_name_that_is_no_utf_8_is_told_and_kept_like_any_other(tmp_path: Path, capsys: Said):
    card, owner = write(tmp_path / "card", GOOD), tmp_path / "owner"
    (card / os.fsdecode(b"caf\xe9.pem")).write_text("")
    assert apply(card, owner, "11112222") == 0
    assert looked(owner)[3].startswith("caf\\udce9.pem: is not read")


def test_a_data_partition_that_takes_nothing_is_told(tmp_path: Path, capsys: Said):
    (tmp_path / "owner").write_text("")
    assert apply(write(tmp_path / "card", GOOD), tmp_path / "owner", "11112222") == 1
    assert "captain: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("place", "code", "said"), [("pipe", 141, ""), ("/dev/full", 1, "cannot write: No space left")]
)
def test_what_cannot_be_printed_is_none_of_the_cards_trouble(tmp_path: Path, place: str, code: int, said: str):
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


def test_no_room_beside_the_card_is_told_as_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(box, "verdict", full)
    card = write(tmp_path, GOOD)
    assert cli.main(["box", "check", str(card)]) == 1
    error = capsys.readouterr().err
    assert "No space left on device" in error
    assert "TMPDIR" in error
    assert str(card) not in error
