"""Unit of the station in systemd: its options, and its end."""

import configparser
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware import systemd
from firmware.client import arguments, client
from image import own_files
from image.own_files import CARD, PACKAGE

UNIT = "usr/lib/systemd/system/captain.service"
SHOWN = """\
Restart=always
NRestarts=0
Result=success
ExecMainStatus=0
ExecStart={{ path={path} ; argv[]={line} ; ignore_errors=no ; start_time=[n/a] ; pid=0 ; code=(null) ; status=0/0 }}
WorkingDirectory=!/data/owner/current
Environment={environment}
EnvironmentFiles={files} (ignore_errors=yes)
LoadState=loaded
ActiveState=active
SubState=running
"""


def shown(form: str, files: Path) -> str:
    """As `systemctl show` of systemd 257 tells a form of our unit."""
    found = configparser.RawConfigParser(strict=False, delimiters="=")
    found.read_string(own_files.read(UNIT, form))
    line = found["Service"]["ExecStart"]
    environment = found["Service"]["Environment"].replace("@BOARD@", "quad")
    if form == CARD:  # the last of several lines is the one that is read
        environment = f"CAPTAIN_CONFIG=/etc/captain/captain.toml CAPTAIN_BOARD=quad {environment}"
    return SHOWN.format(path=line.split()[0], line=line, environment=environment, files=files)


def unit(**more: str) -> systemd.Unit:
    return {"LoadState": "loaded", "ActiveState": "active", "SubState": "running", "Result": "success"} | more


def test_a_box_runs_what_its_owner_has_in_force(tmp_path: Path):
    files = tmp_path / "environment"
    found = systemd.read(shown(CARD, files))
    assert found is not None
    before = "--config /etc/captain/captain.toml --board quad --defaults /etc/captain/captain.toml"
    assert systemd.options(found) == before.split()
    files.write_text("CAPTAIN_CONFIG=/data/owner/current/captain.toml\nCAPTAIN_BOARD=/data/owner/current/board.toml\n")
    words = systemd.options(found)
    assert words[:4] == ["--config", "/data/owner/current/captain.toml", "--board", "/data/owner/current/board.toml"]


def test_the_units_of_image_and_package_are_those_that_the_code_knows(tmp_path: Path):
    assert f"EnvironmentFile=-{systemd.IMAGE}" in own_files.read(UNIT, CARD)
    assert systemd.IMAGE not in own_files.read(UNIT, PACKAGE)


def test_options_of_a_package_are_as_many_words_as_they_have(tmp_path: Path):
    files = tmp_path / "default"
    found = systemd.read(shown(PACKAGE, files))
    assert found is not None
    assert systemd.options(found) == ["--config", "/etc/captain/captain.toml", "--board", "none"]
    files.write_text(
        "# what sits in this machine\nCAPTAIN_BOARD=pi\nCAPTAIN_OPTIONS='--log debug --set station.name=a'\n"
    )
    assert systemd.options(found)[3:] == ["pi", "--log", "debug", "--set", "station.name=a"]


@pytest.mark.parametrize("text", ["", "LoadState=not-found\n", "LoadState=masked\n", "rubbish"])
def test_a_unit_that_is_not_loaded_is_none(text: str):
    assert systemd.read(text) is None


def test_where_systemd_does_not_run_nobody_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(systemd, "MANAGER", tmp_path / "none")
    assert systemd.ask() is None
    monkeypatch.setattr(systemd, "MANAGER", tmp_path)
    monkeypatch.setattr(systemd, "SHOW", ("no-such-program",))
    assert systemd.ask() is None


def test_paths_begin_where_the_unit_says_or_at_the_root(tmp_path: Path):
    assert systemd.folder({"WorkingDirectory": f"!{tmp_path}"}) == str(tmp_path)
    assert systemd.folder({"WorkingDirectory": "!/no/such"}) == systemd.folder({}) == "/"


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({}, "captain.service is active (running)"),
        ({"ActiveState": "inactive", "SubState": "dead"}, "captain.service is inactive (dead)"),
        (
            {
                "ActiveState": "failed",
                "SubState": "failed",
                "Result": "exit-code",
                "ExecMainStatus": "1",
                "NRestarts": "5",
            },
            "captain.service is failed, its last run: exit-code 1, started again 5 times",
        ),
        ({"ActiveState": "activating", "SubState": "auto-restart"}, "captain.service is activating (auto-restart)"),
    ],
)
def test_a_unit_is_told_in_words(more: dict[str, str], words: str):
    assert systemd.state(unit(**more)) == words


LOOP = {"ActiveState": "activating", "SubState": "auto-restart", "NRestarts": "7"}
ON_BOX = {"EnvironmentFiles": "/run/captain-image/environment (ignore_errors=yes)"}


@pytest.mark.parametrize(
    ("more", "remedy"),
    [
        (LOOP | ON_BOX, systemd.CORRECT_CARD),
        ({"ActiveState": "inactive"} | ON_BOX, systemd.RESTART_BOX),
        ({"ActiveState": "activating", "SubState": "start"} | ON_BOX, "it is starting: check again in a minute"),
        ({"ActiveState": "inactive"}, "it is started by `systemctl start captain.service`"),
        (
            LOOP | {"ExecStart": "{ argv[]=/usr/bin/captain run --config /etc/a.toml ; ignore_errors=no ; }"},
            "correct /etc/a.toml, then `systemctl restart captain.service`",
        ),
    ],
)
def test_the_remedy_is_one_that_the_reader_can_do(more: dict[str, str], remedy: str):
    assert systemd.remedy(unit(**more)) == remedy


# -- last words


def said(*messages: object) -> str:
    return "\n".join(json.dumps({"MESSAGE": message}) for message in messages)


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        (
            ("captain: INFO: a is ready", "captain: a.toml: x: wrong", "  (write y)", "captain.time: WARNING: no list"),
            "a.toml: x: wrong (write y)",
        ),
        (("captain: one", "captain: two", "  (go)"), "two (go)"),
        (("Traceback (most recent call last):", '  File "a.py", line 1', "ValueError: x"), "ValueError: x"),
        (("captain.board: ERROR: its worker has ended",), "captain.board: ERROR: its worker has ended"),
        (("captain: INFO: a is ready",), ""),
        ((), ""),
        (([1, 2], None, 7), ""),
    ],
)
def test_the_last_words_are_the_newest_that_are_no_note(messages: tuple[object, ...], words: str):
    assert systemd.last_words(said(*messages)) == words


@given(st.text(max_size=200), st.lists(st.text(max_size=500)))
def test_whatever_the_journal_says_last_words_are_bounded(rubbish: str, messages: list[str]):
    assert len(systemd.last_words(f"{rubbish}\n{said(*messages)}")) <= systemd.MOST


# -- what a person is told of a station that does not answer


@pytest.mark.parametrize("is_service", [True, False])
def test_a_second_station_is_advised_only_where_there_is_no_service(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_service: bool
):
    monkeypatch.setattr(systemd, "MANAGER", tmp_path)
    monkeypatch.setattr(systemd, "FOLDERS", (tmp_path,))
    if is_service:
        (tmp_path / systemd.UNIT).touch()
    with pytest.raises(client.StationError) as caught:
        client.ask(tmp_path / "control", "status")
    assert ("captain run" in caught.value.hint) != is_service
    assert ("`systemctl status captain`" in caught.value.hint) == is_service
    with pytest.raises(client.StationError, match="no station answers") as caught:
        client.reach("..", 5558)
    assert caught.value.hint == "check the host name"


def test_options_that_are_given_are_not_the_services(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(systemd, "ask", unit)
    parser = arguments.argparse.ArgumentParser()
    arguments.add_configuration(parser)
    for words in (["--board", "sim"], ["--config", "a"], ["--set", "station.name=a"], ["--defaults", "a"]):
        assert arguments.as_service(parser.parse_args(words)) is None
    assert arguments.as_service(parser.parse_args([])) is not None
