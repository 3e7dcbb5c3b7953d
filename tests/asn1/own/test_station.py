"""Registration of own messages with the station: rows of types.toml, its place, refusals."""

import os
import tomllib
from collections.abc import Sequence
from pathlib import Path

import pytest

from asn1 import cli
from asn1.own import station
from asn1.own.wish import WishError
from tests.said import tells

ASN = """
My-Module DEFINITIONS AUTOMATIC TAGS ::= BEGIN
Alarm ::= SEQUENCE { protocolVersion INTEGER (0..255), messageID INTEGER (0..255), level INTEGER (0..7) }
END
"""


@pytest.fixture
def types(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the path of the station's file, which does not exist yet."""
    path = tmp_path / "etc" / "types.toml"
    monkeypatch.setenv("CAPTAIN_TYPES", str(path))
    return path


def add(folder: Path, name: str = "my-alarm", number: int = 240, *more: str) -> int:
    (folder / "my.asn").write_text(ASN)
    words = ["add", str(folder / "my.asn"), "--pdu", "Alarm", "--name", name, "--id", str(number), "--port", "2999"]
    return cli.main([*words, *more, "--to", str(folder / "own")])


def remove(folder: Path, name: str) -> int:
    return cli.main(["remove", name, "--to", str(folder / "own")])


def rows(path: Path) -> list[dict[str, object]]:
    found: list[dict[str, object]] = tomllib.loads(path.read_text()).get("types", [])
    return found


def test_message_that_is_added_has_a_row_with_defaults_that_the_output_names(
    tmp_path: Path, types: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert add(tmp_path) == 0
    row = {"number": 240, "name": "my_alarm", "btp_port": 2999, "priority": 3, "lifetime_s": 1.0, "traffic_class": 2}
    assert rows(types) == [row]
    assert [one.name for one in types.parent.iterdir()] == ["types.toml"]
    said = capsys.readouterr().out
    assert (
        f"registered in {types}: type my_alarm, messageID 240, BTP port 2999, "
        "traffic class 2, priority 3, lifetime 1 s\n" in said
    )
    assert tells(said, "\n", "stations", "new type", "second")


def test_options_of_add_are_in_the_row(tmp_path: Path, types: Path) -> None:
    assert add(tmp_path, "my-alarm", 240, "--traffic-class", "1", "--priority", "0", "--lifetime", "2.5") == 0
    (row,) = rows(types)
    assert (row["traffic_class"], row["priority"], row["lifetime_s"]) == (1, 0, 2.5)


def test_replaced_message_has_one_row_with_the_new_numbers(tmp_path: Path, types: Path) -> None:
    assert add(tmp_path) == 0
    assert add(tmp_path, "my-alarm", 241, "--replace") == 0
    assert [(row["name"], row["number"]) for row in rows(types)] == [("my_alarm", 241)]


def test_removed_message_has_no_row_and_the_others_keep_theirs(
    tmp_path: Path, types: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert add(tmp_path, "one", 240) == add(tmp_path, "two", 241) == 0
    kept = rows(types)[1:]
    assert remove(tmp_path, "one") == 0
    assert rows(types) == kept
    assert f"removed: type one from {types}; restart your stations" in capsys.readouterr().out
    assert remove(tmp_path, "two") == 0
    assert rows(types) == []


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (2, ("messageID 2 ", "cam-1.4.1; ", "[[types]]", "captain.toml")),
        (240, ("messageID 240 ", "one; ", "--id")),
    ],
)
def test_message_with_a_known_number_is_added_and_not_registered(
    tmp_path: Path, types: Path, capsys: pytest.CaptureFixture[str], number: int, said: tuple[str, ...]
) -> None:
    assert add(tmp_path, "one", 240) == 0
    before = types.read_text()
    assert add(tmp_path, "two", number) == 0
    place = str(types) if number == 240 else ""
    assert tells(capsys.readouterr().err, "warning: ", "not registered", f": {place}", *said)
    assert types.read_text() == before
    assert (tmp_path / "own" / "two.toml").exists()


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--traffic-class", "256", "--traffic-class 256: out of range; 0 to 255"),
        ("--priority", "-1", "--priority -1: out of range; 0 to 7"),
        ("--priority", "8", "--priority 8: out of range; 0 to 7"),
        ("--lifetime", "nan", "--lifetime nan: out of range; 0 to 86400"),
        ("--lifetime", "1e9", "--lifetime 1000000000.0: out of range; 0 to 86400"),
    ],
)
def test_value_that_the_station_refuses_is_refused_before_anything_is_written(
    tmp_path: Path, types: Path, capsys: pytest.CaptureFixture[str], option: str, value: str, said: str
) -> None:
    assert add(tmp_path, "my-alarm", 240, f"{option}={value}") == 1
    assert said in capsys.readouterr().err
    assert not types.exists()
    assert not (tmp_path / "own").exists()


@pytest.mark.parametrize(
    "text", ["[[types", "types = 3", "[[types]]\nnumber = 3", "[station]\nname = 'x'", "types = [3]", "\udcff"]
)
@pytest.mark.parametrize("command", ["add", "remove"])
def test_file_that_is_not_one_of_types_stays_as_it_is_and_nothing_is_done(
    tmp_path: Path, types: Path, capsys: pytest.CaptureFixture[str], text: str, command: str
) -> None:
    assert add(tmp_path, "one", 240) == 0
    own = sorted((tmp_path / "own").iterdir())
    octets = text.encode("utf-8", "surrogateescape")
    types.write_bytes(octets)
    assert (add(tmp_path, "two", 241) if command == "add" else remove(tmp_path, "one")) == 1
    assert f"{types}: " in capsys.readouterr().err
    assert types.read_bytes() == octets
    assert sorted((tmp_path / "own").iterdir()) == own


def test_empty_variable_leaves_the_station_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CAPTAIN_TYPES", "")
    assert add(tmp_path) == 0
    assert tells(capsys.readouterr().out, "not registered", ": CAPTAIN_TYPES ", "empty")
    assert remove(tmp_path, "my-alarm") == 0


PLACES: Sequence[tuple[dict[str, str], int, str]] = (
    ({"CAPTAIN_TYPES": "/a/b.toml", "HOME": "/home/me"}, 1000, "/a/b.toml"),
    ({"HOME": "/home/me"}, 1000, "/home/me/.config/captain/types.toml"),
    ({"HOME": "/home/me", "XDG_CONFIG_HOME": "/xdg"}, 1000, "/xdg/captain/types.toml"),
    ({"HOME": "/root"}, 0, "/etc/captain/types.toml"),
)


@pytest.mark.parametrize(("environment", "user", "place"), PLACES)
def test_place_of_the_file_is_that_of_the_variable_the_user_or_the_machine(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str], user: int, place: str
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: user)
    assert station.file_of(environment) == Path(place)


def test_row_that_cannot_be_a_name_in_envelopes_is_spelt_with_underscores() -> None:
    assert station.type_name("my-alarm.2") == "my_alarm_2"
    with pytest.raises(WishError, match="--lifetime -1"):
        station.TypeRow(1, "a", 2, lifetime_s=-1).check()
