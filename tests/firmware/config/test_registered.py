"""Registered message types: rows of types.toml beside those of captain.toml."""

import os
from pathlib import Path

import pytest

from asn1.own import station as writer
from board.runtime.errors import ConfigurationError
from firmware.config import captain_toml, registered
from firmware.config.tables import TypeConfig

HELLO = writer.TypeRow(200, "hello", 3000, traffic_class=1)


@pytest.fixture
def types(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "types.toml"
    monkeypatch.setenv("CAPTAIN_TYPES", str(path))
    return path


def loaded(folder: Path, text: str) -> captain_toml.Config:
    (folder / "captain.toml").write_text(text)
    return captain_toml.load(str(folder / "captain.toml"))


def mistakes(folder: Path, text: str = "") -> str:
    with pytest.raises(ConfigurationError) as caught:
        loaded(folder, text)
    return caught.value.message


def test_row_that_captain_asn1_has_written_is_a_type_of_the_station(tmp_path: Path, types: Path) -> None:
    writer.Types(types).add(HELLO)
    wanted = TypeConfig(200, "hello", 3000, priority=3, lifetime_s=1.0, traffic_class=1)
    read = loaded(tmp_path, "")
    assert read.tables.types == (wanted,)
    assert read.types == (str(types),)
    assert captain_toml.load(None).tables.types == (wanted,)


def test_rows_of_captain_toml_win_by_number_and_by_name(tmp_path: Path, types: Path) -> None:
    for row in (HELLO, HELLO._replace(number=201, name="more"), HELLO._replace(number=202, name="last")):
        writer.Types(types).add(row)
    own = '[[types]]\nnumber = 200\nname = "mine"\n[[types]]\nnumber = 9\nname = "more"\n'
    found = loaded(tmp_path, own).tables.types
    assert [(one.number, one.name, one.btp_port) for one in found] == [
        (200, "mine", None),
        (9, "more", None),
        (202, "last", 3000),
    ]


def test_policy_may_name_a_registered_type(tmp_path: Path, types: Path) -> None:
    policy = "[[policy]]\nmatch.type = ['hello']\ninterfaces = ['*']\n"
    assert "unknown type 'hello'" in mistakes(tmp_path, policy)
    writer.Types(types).add(HELLO)
    assert loaded(tmp_path, policy).tables.policy[0].match.type == ("hello",)


def test_configuration_has_another_digest_with_a_registered_type(tmp_path: Path, types: Path) -> None:
    before = loaded(tmp_path, "")
    writer.Types(types).add(HELLO)
    after = loaded(tmp_path, "")
    assert before.digest != after.digest
    assert before.digests()["[types]"] != after.digests()["[types]"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[types]]\nnumber = 256\nname = 'x'\n", "types[0].number: 256 is out of range"),
        ("[[types]]\nnumber = 1\nname = 'X'\n", 'types[0].name: invalid type name "X"; use only a-z'),
        ("[[types]]\nname = 'x'\n", "types[0].number: is missing"),
        ("[[types]]\nnumber = 1\nname = 'x'\ncolour = 3\n", "types[0].colour: is not a known key"),
        ("types = 3\n", "types: 3 is an integer"),
        ("[station]\nname = 'x'\n", "station: is not a known key"),
        ("[[types\n", "line 1"),
        ("[[types]]\nnumber = 1\nname = 'x'\n[[types]]\nnumber = 1\nname = 'y'\n", "types: number 1: given 2 times"),
    ],
)
def test_mistake_of_the_file_is_reported_as_in_captain_toml_with_its_name(
    tmp_path: Path, types: Path, text: str, said: str
) -> None:
    types.write_text(text)
    assert f"{types}: {said}" in mistakes(tmp_path)


def test_mistakes_of_both_files_are_reported_together(tmp_path: Path, types: Path) -> None:
    types.write_text("[[types]]\nnumber = 256\nname = 'x'\n")
    said = mistakes(tmp_path, "[[types]]\nnumber = 257\nname = 'y'\n")
    assert f"{types}: types[0].number: 256" in said
    assert f"{tmp_path / 'captain.toml'}: types[0].number: 257" in said


def test_table_of_types_that_is_no_array_is_reported_once(tmp_path: Path, types: Path) -> None:
    writer.Types(types).add(HELLO)
    assert mistakes(tmp_path, "[types]\nnumber = 1\n").count("types: ") == 1


def test_configuration_of_a_card_does_not_read_the_types_of_this_machine(tmp_path: Path, types: Path) -> None:
    writer.Types(types).add(HELLO)
    found, errors = captain_toml.examine(None)
    assert errors == []
    assert found is not None
    assert found.tables.types == ()


def test_user_and_machine_have_a_file_each_and_the_first_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = tmp_path / "etc.toml"
    monkeypatch.setattr(registered, "SYSTEM", str(machine))
    environment = {"HOME": str(tmp_path)}
    assert registered.files(environment) == ()
    user = tmp_path / ".config/captain/types.toml"
    writer.Types(machine).add(HELLO)
    writer.Types(machine).add(HELLO._replace(number=201, name="more"))
    writer.Types(user).add(HELLO._replace(btp_port=3001))
    paths = registered.files(environment)
    assert paths == (str(user), str(machine))
    found = registered.completed({}, paths, [])["types"]
    assert [(row["number"], row["btp_port"]) for row in found] == [(200, 3001), (201, 3000)]


@pytest.mark.parametrize("user", [0, 1000])
@pytest.mark.parametrize("variable", ["CAPTAIN_TYPES", "XDG_CONFIG_HOME", "HOME"])
def test_file_that_captain_asn1_writes_is_one_that_the_station_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, user: int
) -> None:
    machine = tmp_path / "etc" / "types.toml"
    monkeypatch.setattr(registered, "SYSTEM", str(machine))
    monkeypatch.setattr(writer, "SYSTEM", machine)
    monkeypatch.setattr(os, "geteuid", lambda: user)
    environment = {variable: str(tmp_path / "there")}
    path = writer.file_of(environment)
    assert path is not None
    writer.Types(path).add(HELLO)
    assert registered.files(environment) == (str(path),)


def test_rule_of_both_programs_has_the_same_names() -> None:
    assert (writer.VARIABLE, str(writer.SYSTEM)) == (registered.VARIABLE, registered.SYSTEM)
