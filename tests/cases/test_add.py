"""Modules of users: an import means the module with its object identifier, whatever else was added."""

import dataclasses
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from asn1 import cli as program
from asn1.importer.parser.fault import ImportFault
from asn1.model import text
from asn1.model.types import Module, Reference, Schema, Sequence
from asn1.own import add

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


@pytest.fixture(scope="module")
def schema() -> Schema:
    return text.load_schema()


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the Python module: a second build there compiles only what differs."""
    return tmp_path_factory.mktemp("python")


def wish(case: str, *others: Path, **changes: Any) -> add.UserRequest:
    pdu = {"order-a": "Hello", "order-b": "World", "oid-version1": "Old", "import-absent": "Gone"}[case]
    return add.UserRequest(HERE / f"{case}.asn", pdu, pdu.lower(), 240, 2500, others=others)._replace(**changes)


def with_added(schema: Schema, folder: Path) -> Schema:
    """As `add` finds it where messages of users lie beside the standards."""
    more = text.load_schema(folder, editions=Path(os.devnull))
    return Schema({**schema.modules, **more.modules}, {**schema.messages, **more.messages})


def files(folder: Path, name: str) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if name in path.name}


def component(module: Module, definition: str, at: int) -> object:
    """The type of a component in the root of a SEQUENCE."""
    type_ = module.definitions[definition].type
    assert isinstance(type_, Sequence)
    return type_.root[at].type


def test_a_message_is_the_same_whatever_was_added_before(tmp_path: Path, schema: Schema):
    add.add(wish("order-b"), schema, tmp_path / "alone")
    add.add(wish("order-a"), schema, tmp_path / "both")
    added = add.add(wish("order-b"), with_added(schema, tmp_path / "both"), tmp_path / "both")
    assert files(tmp_path / "both", "world") == files(tmp_path / "alone", "world")
    assert added.imported == ("ETSI TS 102 894-2 v1.3.1",)


def test_an_own_copy_of_a_standard_s_module_is_of_its_message_alone(tmp_path: Path, schema: Schema):
    add.add(wish("order-b"), schema, tmp_path)
    before = files(tmp_path, "world")
    added = add.add(wish("order-a"), with_added(schema, tmp_path), tmp_path)
    hello = text.load_schema(tmp_path, editions=Path(os.devnull)).modules["x_hello"]
    assert component(hello, "Hello", 0) == Reference(module="x1_hello", name="ItsPduHeader")
    assert added.imported == ()
    assert added.notes == (
        "order-a.asn: ITS-Container has the name and identifier of ETSI TS 102 894-2 v1.3.1; only hello uses the one of your file",
    )
    assert files(tmp_path, "world") == before


def test_removing_a_message_leaves_the_others_as_they_were(tmp_path: Path, schema: Schema):
    add.add(wish("order-a"), schema, tmp_path)
    add.add(wish("order-b"), with_added(schema, tmp_path), tmp_path)
    before = files(tmp_path, "world")
    add.remove("hello", tmp_path)
    assert files(tmp_path, "") == before


@pytest.mark.parametrize("order", [("order-a", "order-b", "oid-version1"), ("oid-version1", "order-b", "order-a")])
def test_each_message_has_its_own_bits_in_any_order_of_adding(tmp_path: Path, library: Path, order: tuple[str, ...]):
    for case in order:
        one = wish(case)
        line = ["add", one.file, "--pdu", one.pdu, "--name", one.name, "--id", one.id, "--port", one.port]
        assert program.main([*map(str, line), "--to", str(tmp_path / "own")]) == 0
    generate = ["generate", *("hello", "world", "old"), "--with", str(tmp_path / "own"), "--format", "python"]
    subprocess.run(
        [sys.executable, "-m", "asn1", *generate, "--to", str(library)],
        check=True, capture_output=True, cwd=ROOT, env={**os.environ, "CFLAGS": "-O0"},
    )  # fmt: skip
    code = (
        "import captain_messages as m; h = {'protocolVersion': 2, 'messageID': 240, 'stationID': 7}\n"
        "print(m.find('hello').encode({'header': h, 'greeting': 5}).hex())\n"
        "print(m.find('world').encode({'header': h, 'where': 470654321}).hex())\n"
        "bend = {'curvatureValue': 386, 'curvatureConfidence': 'unavailable'}\n"
        "print(m.find('old').encode({'header': h, 'bend': bend}).hex())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(library)},
    )  # fmt: skip
    # Latitude: 31 bits from -900000000 on (X.691 11.5.6).
    latitude = f"{(470654321 + 900000000) << 1:08x}"
    # CurvatureValue of TS 102 894-2 v1.2.1: 16 bits from -30000 on (11 from -1023 on in v1.3.1); the last of 8 items.
    bend = f"{(386 + 30000) << 8 | 7 << 5:06x}"
    assert done.stdout.split() == ["02f00000000705", f"02f000000007{latitude}", f"02f000000007{bend}"]


def test_an_import_of_version_1_takes_that_edition(tmp_path: Path, schema: Schema):
    added = add.add(wish("oid-version1"), schema, tmp_path)
    old = text.load_schema(tmp_path, editions=Path(os.devnull)).modules["x_old"]
    assert added.imported == ("ETSI TS 102 894-2 v1.2.1",)
    assert component(old, "Old", 1) == Reference(module="r1_cdd121", name="Curvature")


def without(schema: Schema, oid: str) -> Schema:
    """The schema without the modules whose object identifier ends so."""
    return dataclasses.replace(
        schema, modules={key: one for key, one in schema.modules.items() if not one.oid.endswith(oid)}
    )


def test_an_import_of_a_version_that_is_not_here_names_what_there_is(tmp_path: Path, schema: Schema):
    with pytest.raises(ImportFault) as caught:
        add.add(wish("oid-version1"), without(schema, "ts(102894) cdd(2) version(1) }"), tmp_path / "out")
    assert str(caught.value) == (
        "oid-version1.asn:2: unknown version(1) of ITS-Container; available: version(2) (ETSI TS 102 894-2 v1.3.1)"
    )
    assert not (tmp_path / "out").exists()


def test_a_name_that_the_imported_module_lacks_is_named_with_the_one_that_is_meant(tmp_path: Path, schema: Schema):
    with pytest.raises(ImportFault) as caught:
        add.add(wish("import-absent"), schema, tmp_path / "out")
    told = str(caught.value)
    assert "import-absent.asn:2: " in told
    assert "ETSI-ITS-CDD v2.1.1 has no ActionID; ActionId? Or copy the definition of ActionID from the standard" in told
    assert not (tmp_path / "out").exists()


def test_the_name_that_is_meant_is_taken(tmp_path: Path, schema: Schema):
    file = tmp_path / "gone.asn"
    file.write_text((HERE / "import-absent.asn").read_text().replace("ActionID", "ActionId"))
    added = add.add(wish("import-absent", file=file), schema, tmp_path / "out")
    assert added.imported == ("ETSI TS 102 894-2 v2.1.1",)


def test_the_files_of_a_message_are_given_at_once(tmp_path: Path, schema: Schema):
    hello, common = tmp_path / "hello.asn", tmp_path / "common.asn"
    first, end, second = (HERE / "order-a.asn").read_text().partition("END\n")
    hello.write_text(first + end)
    common.write_text(second)
    added = add.add(wish("order-a", common, file=hello), schema, tmp_path / "two")
    assert [path.name for path in added.paths] == ["x_hello.schema", "x1_hello.schema", "hello.toml"]
    again = add.add(wish("order-a", hello, file=common), schema, tmp_path / "turned")
    assert again.message.pdu.name == "Hello"
    assert again.imported == added.imported == ()


def test_the_same_module_in_two_files_is_read_once(tmp_path: Path, schema: Schema):
    copy = tmp_path / "copy.asn"
    shutil.copy(HERE / "order-a.asn", copy)
    added = add.add(wish("order-a", copy), schema, tmp_path / "out")
    assert [path.name for path in added.paths] == ["x_hello.schema", "x1_hello.schema", "hello.toml"]
    copy.write_text(copy.read_text().replace("(0..255) }\nEND\nITS", "(0..254) }\nEND\nITS"))
    with pytest.raises(
        ImportFault, match=r"copy.asn:1: module Hello differs from its definition at order-a.asn:1; remove one"
    ):
        add.add(wish("order-a", copy, replace=True), schema, tmp_path / "out")
