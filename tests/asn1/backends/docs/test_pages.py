"""Pages of messages: have what a developer looks up."""

from pathlib import Path

import pytest

from asn1.backends.docs import pages
from tests.asn1.example import schema

PAGE = pages.page(schema(), schema().messages["demo-1.0.0"])


def row(start: str) -> list[str]:
    """The cells of the one row of a table that begins so."""
    (found,) = [line for line in PAGE.splitlines() if line.startswith(f"| {start}")]
    return [cell.strip() for cell in found.strip("|").split("|")]


def test_a_page_says_what_announces_the_message():
    assert row("messageID") == ["messageID", "99"]
    assert row("protocolVersion") == ["protocolVersion", "1, 2"]
    assert row("BTP port") == ["BTP port", "2099"]
    assert row("standard") == ["standard", "Demo TS 1 v1.0.0"]


def test_a_field_has_type_presence_range_and_unit():
    assert row("`speed`") == ["`speed`", "[Speed](#r9_demo.Speed)", "always", "0..16383", "0.01 m/s"]


def test_a_narrower_constraint_of_a_field_stands_in_place_of_its_type_s():
    assert row("`slow`") == ["`slow`", "[Speed](#r9_demo.Speed)", "optional", "0..100", "0.01 m/s"]


def test_a_default_and_a_unit_of_the_field_itself_are_shown():
    assert row("`width`") == ["`width`", "INTEGER", "default 2", "1..8", "m"]


def test_an_extension_addition_says_which_it_is():
    assert row("`late`")[2] == "extension 1"
    assert row("`first`")[2] == "extension 2"
    assert row("`second`")[2] == "extension 2, optional"


def test_a_list_says_of_what_and_how_many():
    assert row("`shapes`") == ["`shapes`", "SEQUENCE OF [Shape](#r9_demo.Shape)", "always", "size 0..3, extensible", ""]


def test_special_values_named_bits_and_items_are_listed():
    assert row("16383") == ["16383", "unavailable"]
    assert row("1 | high") == ["1", "high"]
    assert row("2 | tram") == ["2", "tram (extension)"]


def test_an_identifier_of_an_open_type_has_the_range_of_its_class():
    assert row("`id` | INTEGER") == ["`id`", "INTEGER", "always", "0..15", ""]


def test_an_open_type_lists_what_it_may_hold():
    assert row("1 | [Box]") == ["1", "[Box](#r9_demo.Box)"]


def test_every_type_has_a_clause_and_every_link_a_place():
    targets = {line.split('"')[1] for line in PAGE.splitlines() if line.startswith("## ")}
    links = {part.split(")")[0] for part in PAGE.split("](#")[1:]}
    assert links <= targets
    sections = PAGE.split("\n## ")[1:]
    assert all("\nClause: " in section for section in sections)
    assert "Clause: Demo TS 1 v1.0.0, Speed" in PAGE


def test_a_type_stands_there_once():
    heads = [line for line in PAGE.splitlines() if line.startswith("## ")]
    assert len(heads) == len(set(heads))
    assert sum(line.endswith(">Box") for line in heads) == 1


def test_the_same_schema_gives_the_same_pages(tmp_path: Path):
    steps: list[str] = []
    for folder in ("a", "b"):
        pages.write(schema(), ["demo-1.0.0"], tmp_path / folder, steps.append)
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["README.md", "demo-1.0.0.md"]
    assert steps == ["demo-1.0.0", "demo-1.0.0"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize("name", ["demo-1.0.0.md"])
def test_the_index_links_every_page(tmp_path: Path, name: str):
    pages.write(schema(), ["demo-1.0.0"], tmp_path, lambda what: None)
    assert f"]({name})" in (tmp_path / "README.md").read_text()
