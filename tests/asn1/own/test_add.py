"""User-defined message: one command adds it to those of the standards."""

import os
from pathlib import Path
from typing import Any

import pytest

from asn1.importer.parser.fault import ImportFault
from asn1.importer.parser.module_parser import read
from asn1.model import text
from asn1.model.types import Reference, Schema
from asn1.own import add, files
from tests.said import tells

PLAIN = """
My-Module DEFINITIONS AUTOMATIC TAGS ::= BEGIN
Alarm ::= SEQUENCE { level INTEGER (0..7), text UTF8String OPTIONAL, ... }
END
"""
WITH_IMPORT = """
My-Module { iso(1) mine(99) } DEFINITIONS AUTOMATIC TAGS ::= BEGIN
IMPORTS ItsPduHeader, ReferencePosition FROM ITS-Container {
  itu-t (0) identified-organization (4) etsi (0) itsDomain (5) wg1 (1) ts (102894) cdd (2) version (2) };
Alarm ::= SEQUENCE { header ItsPduHeader, place ReferencePosition, loud Loudness }
Loudness ::= INTEGER { silent(0) } (0..100)
END
"""


@pytest.fixture(scope="module")
def schema() -> Schema:
    return text.load_schema()


def wish(folder: Path, content: str, **changes: Any) -> add.UserRequest:
    file = folder / "alarm.asn"
    file.write_text(content)
    return add.UserRequest(file, "Alarm", "my-alarm", 240, 2999)._replace(**changes)


def loaded(folder: Path) -> Schema:
    return text.load_schema(folder, editions=Path(os.devnull))


def test_a_file_of_its_own_becomes_a_schema_and_a_message(tmp_path: Path, schema: Schema):
    added = add.add(wish(tmp_path, PLAIN), schema, tmp_path / "out")
    found = loaded(tmp_path / "out")
    assert found.messages == {"my-alarm": added.message}
    assert added.message.is_experimental
    assert (added.message.ids, added.message.btp_port) == ((240,), 2999)
    assert found.resolve(added.message.pdu).name == "Alarm"
    assert added.imported == ()


def test_what_it_imports_is_taken_from_the_schema_that_is_here(tmp_path: Path, schema: Schema):
    added = add.add(wish(tmp_path, WITH_IMPORT), schema, tmp_path / "out")
    (module,) = loaded(tmp_path / "out").modules.values()
    assert added.imported == ("ETSI TS 102 894-2 v1.3.1",)
    assert set(module.definitions) == {"Alarm", "Loudness"}
    place = module.definitions["Alarm"].type.root[1].type  # type: ignore[union-attr]
    assert place == Reference(module="r1_cdd", name="ReferencePosition")


def test_a_message_that_is_added_again_is_replaced(tmp_path: Path, schema: Schema):
    add.add(wish(tmp_path, PLAIN), schema, tmp_path / "out")
    known = Schema({**schema.modules, **loaded(tmp_path / "out").modules}, loaded(tmp_path / "out").messages)
    again = wish(tmp_path, PLAIN.replace("0..7", "0..15"), port=3000)
    with pytest.raises(add.WishError, match=r"my-alarm.toml already exists; replace it with --replace"):
        add.add(again, known, tmp_path / "out")
    assert loaded(tmp_path / "out").messages["my-alarm"].btp_port == 2999
    add.add(again._replace(replace=True), known, tmp_path / "out")
    found = loaded(tmp_path / "out")
    assert found.messages["my-alarm"].btp_port == 3000
    assert len(found.modules) == 1


def test_messages_with_the_same_id_are_named(tmp_path: Path, schema: Schema):
    assert "cam-1.4.1" in add.add(wish(tmp_path, PLAIN, id=2), schema, tmp_path / "out").same_id


def test_asn1tools_reads_the_file_as_well(tmp_path: Path, schema: Schema, monkeypatch: pytest.MonkeyPatch):
    added = add.add(wish(tmp_path, PLAIN), schema, tmp_path / "out")
    assert added.notes == ()
    default = PLAIN.replace("level INTEGER (0..7)", "level INTEGER DEFAULT most").replace(
        "END", "most INTEGER ::= 7 END"
    )
    added = add.add(wish(tmp_path, default, replace=True), schema, tmp_path / "out")
    assert added.notes[0].startswith("alarm.asn:1: not compared: asn1tools stops with")
    monkeypatch.setattr(files, "read", lambda words, file: read(words.replace("0..7", "0..8"), file))
    with pytest.raises(ImportFault, match=r"alarm.asn:3: the range of Alarm.level: we read \[\(0, 8\)\], asn1tools"):
        add.add(wish(tmp_path, PLAIN), schema, tmp_path / "other")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"name": "My Alarm"}, "lower-case letters"),
        ({"name": "cam-1.4.1"}, "choose another name"),
        ({"name": "cam"}, "choose another name"),
        ({"id": 256}, "a messageID is 0 to 255"),
        ({"port": -1}, "0 to 65535"),
        ({"versions": (1, 999)}, "--versions 999: out of range; a protocolVersion"),
        ({"pdu": "Alram"}, "did you mean Alarm"),
    ],
)
def test_an_invalid_request_is_explained_and_writes_nothing(
    tmp_path: Path, schema: Schema, changes: dict[str, object], says: str
):
    with pytest.raises(add.WishError, match=says):
        add.add(wish(tmp_path, PLAIN, **changes), schema, tmp_path / "out")
    assert not (tmp_path / "out").exists()


MANY = " ".join(f", a{number} NULL" for number in range(65))


@pytest.mark.parametrize(
    ("type_", "says"),
    [
        ("UTF8String DEFAULT \"none\"", "Alarm_level: a DEFAULT of UTF8"),
        ("BIT STRING DEFAULT '00'B", "Alarm_level: a DEFAULT of BIT_STRING"),
        ("BIT STRING (SIZE(8)) DEFAULT '00'B", "Alarm_level: a DEFAULT of 2 bits where the size is 8"),
        ("OCTET STRING (SIZE(2)) DEFAULT '00'H", "Alarm_level: a DEFAULT of 1 octets where the size is 2"),
        ("INTEGER (0..7) DEFAULT 8", "Alarm_level: a DEFAULT of 8, which is not allowed"),
        ("INTEGER (0..3 | 5..7) DEFAULT 4", "Alarm_level: a DEFAULT of 4, which is not allowed"),
        ("INTEGER (0..7) DEFAULT 300", "Alarm_level: a DEFAULT of 300, which is not allowed"),
        ("INTEGER (0..18446744073709551616)", "Alarm_level: 0..18446744073709551616 is wider than 64 bits"),
        ("INTEGER (18446744073709551616..MAX)", "Alarm_level: numbers wider than 64 bits"),
        ("INTEGER (0..9223372036854775808, ...)", "Alarm_level: numbers wider than 64 bits"),
        ("INTEGER (0..3) (5..7)", "Alarm_level: the constraints leave no value"),
        ("OCTET STRING (SIZE(0..4294967296))", "Alarm_level: a size of more than 4294967294"),
        ("SEQUENCE (SIZE(1..4294967295)) OF BOOLEAN", "Alarm_level: a size of more than 4294967294"),
        ("Alarm", "Alarm: the type contains itself without end: make a recursive component OPTIONAL or a list"),
        ("SEQUENCE (SIZE(1..4)) OF Alarm", "Alarm: the type contains itself without end: make a recursive component OPTIONAL or a list"),
        ("CHOICE { a SEQUENCE { a Alarm }, b Alarm }", "Alarm: the type contains itself without end: make a recursive component OPTIONAL or a list"),
        ("ENUMERATED { far(1073741824) }", "Alarm_level: an item of 1073741824"),
        ("INTEGER { far(9223372036854775808) }", "Alarm_level: a number wider than 64 bits has a name"),
        (f"SEQUENCE {{ a NULL, ... {MANY} }}", "Alarm_level: 65 extension additions, 64 is the most"),
    ],
)  # fmt: skip
def test_what_could_not_be_generated_is_refused_with_its_line(tmp_path: Path, schema: Schema, type_: str, says: str):
    with pytest.raises(ImportFault) as caught:
        add.add(wish(tmp_path, PLAIN.replace("INTEGER (0..7)", type_)), schema, tmp_path / "out")
    assert str(caught.value) == f"alarm.asn:3: {says}"
    assert not (tmp_path / "out").exists()


ALL_AT_ONCE = """
My-Module DEFINITIONS AUTOMATIC TAGS ::= BEGIN
IMPORTS Thing FROM Nowhere Other FROM Elsewhere;
Alarm ::= SEQUENCE { level REAL,
  set SET { a NULL },
  any ANY,
  thing Thing, broken Broken, late Late }
Broken ::= SEQUENCE { a NULL, ... ! 3 }
Late ::= INTEGER (0..nothing)
END
"""


def test_mistakes_of_a_file_are_reported_at_once(tmp_path: Path, schema: Schema):
    with pytest.raises(ImportFault) as caught:
        add.add(wish(tmp_path, ALL_AT_ONCE), schema, tmp_path / "out")
    lines = [line.split(";")[0] for line in str(caught.value).splitlines()]
    *others, undefined = lines
    assert others == [
        "alarm.asn:3: no module Elsewhere",
        "alarm.asn:3: no module Nowhere",
        "alarm.asn:4: unsupported: REAL (X.680 21)",
        "alarm.asn:5: unsupported: SET (X.680 27)",
        "alarm.asn:6: unsupported: ANY (X.680 17)",
        "alarm.asn:8: unsupported: exception identifier (X.680 53)",
    ]
    assert tells(undefined, "alarm.asn:9: nothing ", "defined", "imported")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (PLAIN.replace("INTEGER (0..7)", "REAL"), r"alarm.asn:3: .*REAL"),
        (PLAIN.replace("INTEGER (0..7)", "Levl"), r"alarm.asn:3: Levl is neither defined nor imported"),
        (WITH_IMPORT.replace("ITS-Container", "ITS-Contaner"), r"alarm.asn:3: .*did you mean ITS-Container"),
        ("nothing like it", r"alarm.asn:1: "),
    ],
)
def test_a_file_that_cannot_be_read_is_explained_by_line(tmp_path: Path, schema: Schema, content: str, says: str):
    with pytest.raises(ImportFault, match=says):
        add.add(wish(tmp_path, content), schema, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_may_end_has_an_end(tmp_path: Path, schema: Schema):
    ends = "SEQUENCE { a Alarm OPTIONAL, b SEQUENCE (SIZE(0..4)) OF Alarm, c CHOICE { d Alarm, e NULL } }"
    add.add(wish(tmp_path, PLAIN.replace("INTEGER (0..7)", ends)), schema, tmp_path / "out")


def test_what_was_added_can_be_removed(tmp_path: Path, schema: Schema):
    out = tmp_path / "out"
    one = add.add(wish(tmp_path, PLAIN), schema, out)
    add.add(wish(tmp_path, PLAIN, name="other"), schema, out)
    assert sorted(add.remove("my-alarm", out)) == sorted(one.paths)
    assert list(loaded(out).messages) == ["other"]
    with pytest.raises(add.WishError, match=r"my-alarm: not a message of your own in .*; choose one of other"):
        add.remove("my-alarm", out)
    with pytest.raises(add.WishError, match=r"cam-1.4.1: not a message of your own"):
        add.remove("cam-1.4.1", text.SCHEMA)


def test_a_message_that_is_replaced_leaves_nothing_of_its_file(tmp_path: Path, schema: Schema):
    two = PLAIN.replace("level", "level Level, low") + "Levels DEFINITIONS ::= BEGIN Level ::= INTEGER (0..3) END"
    two = two.replace("::= BEGIN\nAlarm", "::= BEGIN IMPORTS Level FROM Levels;\nAlarm")
    add.add(wish(tmp_path, two), schema, tmp_path / "out")
    assert len(loaded(tmp_path / "out").modules) == 2
    add.add(wish(tmp_path, PLAIN, replace=True), schema, tmp_path / "out")
    assert len(loaded(tmp_path / "out").modules) == 1


def test_a_message_of_two_modules_leaves_room_for_a_name_with_a_number(tmp_path: Path, schema: Schema):
    add.add(
        wish(tmp_path, PLAIN + "Levels DEFINITIONS ::= BEGIN Level ::= INTEGER (0..3) END"), schema, tmp_path / "out"
    )
    added = add.add(wish(tmp_path, PLAIN, name="my-alarm-1"), schema, tmp_path / "out")
    assert added.message.pdu.module == "x_my_alarm_1"
    assert set(loaded(tmp_path / "out").messages) == {"my-alarm", "my-alarm-1"}


def test_two_names_that_are_one_in_c_are_refused(tmp_path: Path, schema: Schema):
    add.add(wish(tmp_path, PLAIN), schema, tmp_path / "out")
    with pytest.raises(add.WishError, match=r"another message has x_my_alarm.schema"):
        add.add(wish(tmp_path, PLAIN, name="my.alarm"), schema, tmp_path / "out")


@pytest.mark.parametrize(
    ("type_", "says"),
    [
        ("SEQUENCE { h SEQUENCE { protocolVersion INTEGER (0..255), messageID INTEGER (0..255) }, a NULL OPTIONAL }",
         "Alarm begins with a bit for each OPTIONAL or DEFAULT component"),
        ("SEQUENCE { h SEQUENCE { protocolVersion INTEGER (0..255), messageID INTEGER (0..255) }, ... }",
         "Alarm begins with an extension bit"),
        ("SEQUENCE { h SEQUENCE { protocolVersion INTEGER (0..255), messageID INTEGER (0..255), ... } }",
         "h begins with an extension bit"),
        ("SEQUENCE { protocolVersion INTEGER (0..255), messageID INTEGER (0..7) }", "messageID is there"),
        ("SEQUENCE { protocolVersion INTEGER (0..255), level INTEGER (0..255) }", "level is there"),
        ("SEQUENCE { protocolVersion INTEGER (0..255) }", "it ends before"),
        ("CHOICE { a NULL, b NULL }", "Alarm is there"),
        ("SEQUENCE { h SEQUENCE { protocolVersion INTEGER (0..255), messageID INTEGER (0..255) }, a Alarm2 }", None),
    ],
)  # fmt: skip
def test_a_message_that_its_first_octets_do_not_announce_is_told(
    tmp_path: Path, schema: Schema, type_: str, says: str | None
):
    content = f"M DEFINITIONS AUTOMATIC TAGS ::= BEGIN Alarm ::= {type_} Alarm2 ::= SEQUENCE {{ ... }} END"
    assert add.add(wish(tmp_path, content), schema, tmp_path / "out").unannounced == says
