"""A directory of modules becomes the schema that editions.toml describes; a change of a module is a readable diff."""

from pathlib import Path

import pytest

from asn1.importer.editions import MODULES, read_editions
from asn1.importer.parser.fault import ImportFault
from asn1.importer.standards import check, import_modules, write_schema
from asn1.model import text
from asn1.model import types as t
from tests.said import tells

EDITIONS = """
[[module]]
key = "r1_data"
name = "Data"
standard = "S 1"
files = ["one/Data.asn", "two/Data.asn"]
units_from = ["r2_data"]

[[module]]
key = "r2_data"
name = "Data"
standard = "S 2"
files = ["three/Data.asn"]

[[module]]
key = "r1_msg"
name = "Msg"
standard = "S 3"
files = ["one/Msg.asn"]
imports = ["r1_data"]

[[message]]
name = "msg-1"
type = "msg"
release = 1
pdu = "r1_msg.Msg"
ids = [99]
"""
UNITS = """
[spelling]
"0.1 metre" = "0.1 m"
[r1_msg]
"Msg.inner.count" = "piece"
"""
DATA = "Data DEFINITIONS AUTOMATIC TAGS ::= BEGIN\nLength ::= INTEGER (0..7)\nOther ::= REAL\nEND"
NEWER = "Data DEFINITIONS AUTOMATIC TAGS ::= BEGIN\n/** @unit 0,1 metre */\nLength ::= INTEGER (0..7)\nEND"
MSG = """Msg { iso (1) } DEFINITIONS AUTOMATIC TAGS ::= BEGIN
IMPORTS Length FROM Data;
Msg ::= SEQUENCE { length Length, inner SEQUENCE { count INTEGER } }
END"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, words in {
        "one/Data.asn": DATA,
        "two/Data.asn": "-- a copy\n" + DATA,
        "three/Data.asn": NEWER,
        "one/Msg.asn": MSG,
        "editions.toml": EDITIONS,
        "units.toml": UNITS,
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(words)
    return tmp_path


def imported(folder: Path) -> t.Schema:
    return import_modules(folder, folder / "editions.toml", folder / "units.toml", folder / "schema")


def refused(folder: Path) -> list[str]:
    with pytest.raises(ImportFault) as error:
        imported(folder)
    return str(error.value).splitlines()


def test_modules_of_one_name_are_told_apart_by_their_keys(folder: Path) -> None:
    schema = imported(folder)
    assert list(schema.modules) == ["r1_data", "r1_msg"]  # nothing of r2_data is reached
    message = schema.messages["msg-1"]
    assert (message.standard, message.ids, message.pdu.module) == ("S 3", (99,), "r1_msg")
    found = schema.resolve(message.pdu).type
    assert isinstance(found, t.Sequence)
    assert found.root[0].type == t.Reference(module="r1_data", name="Length")


def test_a_unit_comes_from_the_same_element_of_release_2(folder: Path) -> None:
    assert imported(folder).modules["r1_data"].definitions["Length"].unit == "0.1 m"


def test_a_unit_does_not_come_from_an_element_of_another_range(folder: Path) -> None:
    (folder / "three/Data.asn").write_text(NEWER.replace("7", "8"))
    assert imported(folder).modules["r1_data"].definitions["Length"].unit is None


def test_a_unit_comes_from_the_table_for_a_component_of_a_component(folder: Path) -> None:
    found = imported(folder).modules["r1_msg"].definitions["Msg"].type
    assert isinstance(found, t.Sequence)
    assert isinstance(found.root[1].type, t.Sequence)
    assert found.root[1].type.root[0].unit == "piece"


def test_a_line_of_the_table_that_names_nothing_is_refused(folder: Path) -> None:
    (folder / "units.toml").write_text('[r1_msg]\n"Msg.inner.size" = "piece"\nMgs = "m"\n')
    assert refused(folder) == [
        "units.toml:1: unknown name: r1_msg: Mgs",
        "units.toml:1: unknown name: r1_msg: Msg.inner.size",
    ]


def test_a_module_is_known_by_its_file_hash_and_object_identifier(folder: Path) -> None:
    module = imported(folder).modules["r1_msg"]
    assert (module.source, module.oid) == ("Msg.asn", "{ iso(1) }")
    assert len(bytes.fromhex(module.sha256)) == 32


def test_copies_of_a_module_that_differ_are_refused(folder: Path) -> None:
    (folder / "two/Data.asn").write_text(DATA.replace("7", "8"))
    (why,) = refused(folder)
    assert tells(why, "two/Data.asn:1: Data ", "differs", "one/Data.asn")


def test_an_edition_whose_files_are_not_there_is_left_out(folder: Path) -> None:
    (folder / "three/Data.asn").unlink()
    assert list(imported(folder).modules) == ["r1_data", "r1_msg"]


def test_import_from_an_absent_edition_is_refused(folder: Path) -> None:
    (folder / "one/Data.asn").unlink()
    (folder / "two/Data.asn").unlink()
    (why,) = refused(folder)
    assert tells(why, "one/Msg.asn:1: ", "imports", "one/Data.asn; ", "missing")


def test_file_without_its_module_is_refused(folder: Path) -> None:
    (folder / "one/Msg.asn").write_text(MSG.replace("Msg {", "Mgs {"))
    (why,) = refused(folder)
    assert tells(why, "one/Msg.asn:1: ", "no module Msg")


def test_a_directory_without_any_module_is_refused(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.raises(ImportFault, match=r"contains no file of editions\.toml"):
        import_modules(tmp_path_factory.mktemp("empty"), folder / "editions.toml", folder / "units.toml")


def test_problems_of_several_files_come_together(folder: Path) -> None:
    (folder / "one/Msg.asn").write_text(MSG.replace("count INTEGER", "count 5"))
    (folder / "three/Data.asn").write_text("Data DEFINITIONS ::= BEGIN\n~\nEND")
    assert [line.split(":")[0] for line in refused(folder)] == ["one/Msg.asn", "three/Data.asn"]


def test_comments_may_be_in_latin_1(folder: Path) -> None:
    (folder / "one/Msg.asn").write_bytes(MSG.encode() + "-- coup\xe9".encode("latin-1"))
    assert "msg-1" in imported(folder).messages


def test_what_could_not_be_generated_is_named_with_its_line(folder: Path) -> None:
    (folder / "one/Msg.asn").write_text(MSG.replace("count INTEGER", "count INTEGER (0..3) (5..7)"))
    with pytest.raises(ImportFault, match=r"^one/Msg.asn:3: Msg_inner_count: the constraints leave no value$"):
        imported(folder)


def test_what_is_written_is_what_is_loaded(folder: Path) -> None:
    schema = imported(folder)
    written = write_schema(schema, folder / "schema")
    assert [path.name for path in written] == ["r1_data.schema", "r1_msg.schema"]
    assert text.load_schema(folder / "schema", folder / "editions.toml") == schema
    assert write_schema(schema, folder / "schema") == []


def test_what_other_editions_use_of_a_module_stays_while_their_files_are_away(folder: Path) -> None:
    before = imported(folder)
    write_schema(before, folder / "schema")
    (folder / "one/Msg.asn").write_text(MSG.replace("length Length, ", "").replace("IMPORTS Length FROM Data;", ""))
    assert list(imported(folder).modules) == ["r1_msg"]
    (folder / "three/Data.asn").unlink()  # and with it the unit
    assert imported(folder).modules["r1_data"] == before.modules["r1_data"]


def test_our_own_module_gives_the_schema_that_is_committed() -> None:
    assert check(MODULES) == []


def test_a_changed_range_is_one_line_of_the_diff(tmp_path: Path) -> None:
    for path in text.SCHEMA.glob("vc.schema"):
        words = path.read_text().replace("trafficClassID: integer (0..255)", "trafficClassID: integer (0..7)", 1)
        (tmp_path / path.name).write_text(words)
    lines = check(MODULES, tmp_path)
    assert [line for line in lines if line[0] in "+-" and line[:3] not in {"+++", "---"}] == [
        "-  trafficClassID: integer (0..7)",
        "+  trafficClassID: integer (0..255)",
    ]


def test_every_edition_of_the_project_has_files_and_imports_that_exist() -> None:
    editions = read_editions()
    for edition in editions.modules.values():
        assert edition.files
        assert set(edition.imports) | set(edition.units_from) <= set(editions.modules)
    for message in editions.messages.values():
        assert message.pdu.module in editions.modules


def test_no_two_messages_of_a_type_have_the_same_rank() -> None:
    ranks = [(message.type, message.rank) for message in read_editions().messages.values()]
    assert len(set(ranks)) == len(ranks)


@pytest.mark.parametrize(
    ("type_", "id_", "port"),
    [
        # ETSI TS 102 894-2 v2.4.1, DE MessageId; ETSI TS 103 248
        ("denm", 1, 2002), ("cam", 2, 2001), ("poi", 3, 2010), ("spatem", 4, 2004), ("mapem", 5, 2003),
        ("ivim", 6, 2006), ("ev_rsr", 7, 2012), ("tistpgtransaction", 8, 2011), ("srem", 9, 2007), ("ssem", 10, 2008),
        ("evcsn", 11, 2010), ("rtcmem", 13, 2013), ("cpm", 14, 2009), ("imzm", 15, 2019), ("vam", 16, 2018),
        ("vam", 102, 2018), ("mcm", 20, 2017),
    ],
)  # fmt: skip
def test_every_edition_of_a_type_has_its_identifier_and_port(type_: str, id_: int, port: int) -> None:
    editions = [one for one in read_editions().messages.values() if one.type == type_]
    assert editions
    assert all(id_ in one.ids and one.btp_port == port for one in editions)


def test_what_cannot_be_read_imported_or_found_is_told_at_once(folder: Path) -> None:
    (folder / "one/Data.asn").write_text(DATA.replace("(0..7)", "(0..)"))
    (folder / "two/Data.asn").unlink()
    broken = MSG.replace("count INTEGER", "count REAL,\nset SET {}").replace(
        "END", "Far ::= SEQUENCE { a NULL, ... ! 3 }\nEND"
    )
    (folder / "one/Msg.asn").write_text(broken)
    assert [line.split(" (")[0] for line in refused(folder)] == [
        "one/Data.asn:2: expected a value, found ')'",
        "one/Msg.asn:3: unsupported: REAL",
        "one/Msg.asn:4: unsupported: SET",
        "one/Msg.asn:5: unsupported: exception identifier",
    ]


SUPERSEDED = (
    "/** @note: this DF is kept for backwards compatibility reasons only. It is recommended to use @ref Length. */"
)


def test_types_that_are_to_be_kept_are_kept_but_for_those_that_the_standard_has_replaced(folder: Path) -> None:
    editions = folder / "editions.toml"
    editions.write_text(EDITIONS.replace('files = ["three/Data.asn"]', 'files = ["three/Data.asn"]\nkeep = ["*"]'))
    old = f"{SUPERSEDED}\nOld ::= INTEGER (0..7)\nmost INTEGER ::= 7\nMore ::= NULL\nEND"
    (folder / "three/Data.asn").write_text(NEWER.replace("END", old))
    found = import_modules(folder, editions, folder / "units.toml", folder / "none")
    assert set(found.modules["r2_data"].definitions) == {"Length", "More"}
    assert found.modules["r2_data"].left_out == ("Old", "most")


def test_names_that_the_schema_leaves_out_are_in_its_text(folder: Path) -> None:
    module = imported(folder).modules["r1_data"]
    assert module.left_out == ("Other",)
    assert "\nleft-out Other\n" in text.dump(module)
    assert text.load(text.dump(module)) == module


def test_the_guide_has_a_row_of_evidence_for_each_edition_with_a_header() -> None:
    whole = (Path(__file__).parents[3] / "asn1/guide/editions.md").read_text()
    table = whole.partition("## Editions by protocolVersion")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines() if line.startswith("| ")]
    said = {name: versions for names, versions, why in rows[1:] if why for name in names.split(", ")}
    strict = [one for one in read_editions().messages.values() if not one.form_of]
    known = {one.name: ", ".join(map(str, one.versions)) for one in strict if one.ids}
    assert said == known
