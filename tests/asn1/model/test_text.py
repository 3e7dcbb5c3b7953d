"""Schema text: exact in both directions, readable, with clear errors."""

import hashlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asn1.model import text
from asn1.model import types as t
from asn1.model.text import SCHEMA, TextError, dump, load, load_schema

PLAIN = """module r1_x X-Module
oid { iso(1) x(2) }
standard ETSI EN 1 v1
source x.asn
sha256 00

class CLS: &Type by &id Id
set S of CLS
  3: r2_y.Other
  ...
type Id: integer (0..255)
type A: sequence ((with {..., a present, b (0..3)}) | (with {..., a absent}))
  a: B optional
  b: integer (0..7, ..., 9) default 3 unit "0.1 m"
    three = 3
  key: field CLS of S
  ...
  [[ 2
    value: open CLS of S by key
  c: list (size (1..4), ...) of list of r2_y.Other (1 | 3..5)
  ...
  d: octets (containing string IA5String (from (65..90)) (size (1..8, ...))) default '0AFF'H
type B: choice
  x: bits (size (7)) default '01'B
    one = 1
  y: enumerated
    p = 0
    ...
    q = 5
  z: set-list of null
"""


def test_a_text_in_its_normal_form_comes_back_unchanged() -> None:
    assert dump(load(PLAIN)) == PLAIN


def test_every_committed_schema_comes_back_unchanged() -> None:
    paths = sorted(SCHEMA.glob("*.schema"))
    assert len(paths) > 50
    for path in paths:
        words = path.read_text(encoding="utf-8")
        assert dump(load(words, path.name)) == words


def test_every_reference_of_the_committed_schema_leads_somewhere() -> None:
    schema = load_schema()
    assert len(schema.messages) > 25
    for message in schema.messages.values():
        assert schema.resolve(message.pdu).name == message.pdu.name


def test_every_message_names_its_type_and_document_version() -> None:
    for message in load_schema().messages.values():
        assert message.name.startswith(f"{message.type}-")
        assert message.standard


def test_own_modules_have_the_hash_that_the_schema_tells() -> None:
    octets = (text.FOLDER / "modules" / "VC-Container.asn").read_bytes()
    assert load_schema().modules["vc"].sha256 == hashlib.sha256(octets).hexdigest()


def test_messages_of_a_folder_of_its_own_are_found(tmp_path: Path) -> None:
    (tmp_path / "x_beacon.schema").write_text(PLAIN.replace("r1_x", "x_beacon"))
    (tmp_path / "beacon.toml").write_text(
        '[[message]]\nname = "beacon-1"\ntype = "beacon"\nrelease = 2\nstandard = "mine"\npdu = "x_beacon.A"\nids = [200]\n'
    )
    schema = load_schema(tmp_path)
    assert list(schema.modules) == ["x_beacon"]
    assert schema.messages["beacon-1"].ids == (200,)
    assert list(schema.messages) == ["beacon-1"]


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        ("sha256 00", "", "x.schema:1: line 'sha256' is missing from the header, above the first blank line"),
        ("  a: B optional", "   a: B optional", "x.schema:13: invalid indentation of this line; two blanks per level"),
        ("  a: B optional", "  a: B optionally", "x.schema:13: 'optionally' is too much"),
        ("  a: B optional", "  a: b", "x.schema:13: unknown type 'b'"),
        ("type Id: integer (0..255)", "type Id: integer (0..255", "x.schema:11: expected ')', found ''"),
        (
            "type Id: integer",
            "kind Id: integer",
            "x.schema:11: 'kind' is not a kind of definition; use type, class or set",
        ),
        ("    three = 3", "    three", "x.schema:15: 'three' is not of the form: name = number"),
        ("(0..255)", "(0..~)", "x.schema:11: '~)' is not a word of a schema"),
        ("(size (7))", "(sizes (7))", "x.schema:24: 'sizes' begins no constraint"),
    ],
)
def test_what_is_no_schema_is_told_with_its_line(before: str, after: str, problem: str) -> None:
    assert before in PLAIN
    with pytest.raises(TextError) as error:
        load(PLAIN.replace(before, after, 1), "x.schema")
    assert str(error.value) == problem


@given(
    at=st.integers(0, len(PLAIN)),
    cut=st.integers(0, 20),
    words=st.sampled_from(["", "(", " ...", "\n", "  ", ": ", "'", "A"]),
)
def test_a_damaged_text_is_taken_or_refused_cleanly(at: int, cut: int, words: str) -> None:
    try:
        load(PLAIN[:at] + words + PLAIN[at + cut :])
    except TextError as error:
        assert str(error).startswith("schema:")


# ---------------------------------------------------------------- any schema at all

NUMBERS = st.integers(-(2**70), 2**70)
NAMES = st.from_regex(r"[a-z][A-Za-z0-9]{0,3}(-[a-z0-9]{1,2})?", fullmatch=True)
REFERENCES = st.builds(t.Reference, module=st.sampled_from(["r1_x", "r2_y"]), name=st.sampled_from(["A", "Be-c", "D9"]))
RANGES = st.tuples(st.none() | NUMBERS, st.none() | NUMBERS)
VALUES = st.lists(RANGES.map(lambda ends: t.Range(*ends)), min_size=1, max_size=3).map(lambda one: t.Values(tuple(one)))


def constraint_of(elements: st.SearchStrategy[t.ElementSet]) -> st.SearchStrategy[t.Constraint]:
    extensible = st.builds(t.Constraint, elements, st.just(True), st.none() | elements)
    return st.builds(t.Constraint, elements) | extensible


def wider(inner: st.SearchStrategy[t.ElementSet]) -> st.SearchStrategy[t.ElementSet]:
    constraints = constraint_of(inner)
    presence = st.sampled_from([None, "PRESENT", "ABSENT", "OPTIONAL"])
    lines = st.lists(st.builds(t.InnerComponent, NAMES, st.none() | constraints, presence), max_size=2).map(tuple)
    members = st.lists(inner, min_size=2, max_size=3).map(tuple)
    several = members.filter(lambda some: not all(isinstance(one, t.Values) for one in some))
    return st.one_of(
        st.builds(t.Size, constraints),
        st.builds(t.Alphabet, constraints),
        st.builds(t.Element, constraints),
        st.builds(t.Inner, st.booleans(), lines),
        st.builds(t.Contents, st.builds(t.CharacterString, st.just("UTF8String")) | REFERENCES),
        st.builds(t.AnyOf, several),
        st.builds(t.AllOf, members),
        st.builds(t.AllExcept, inner),
    )


CONSTRAINTS = st.lists(constraint_of(st.recursive(VALUES, wider, max_leaves=3)), max_size=2).map(tuple)
NAMED = st.lists(st.builds(t.Named, NAMES, NUMBERS), max_size=3).map(tuple)
DEFAULTS = st.one_of(
    st.none(), st.booleans(), NUMBERS, st.text(max_size=5), st.binary(max_size=4),
    st.integers(0, 20).map(lambda bits: (bytes(-(-bits // 8)), bits)),
)  # fmt: skip
LEAVES = st.one_of(
    st.builds(t.Boolean, constraints=CONSTRAINTS),
    st.builds(t.Null),
    st.builds(t.Integer, constraints=CONSTRAINTS, names=NAMED),
    st.builds(t.BitString, constraints=CONSTRAINTS, names=NAMED),
    st.builds(t.OctetString, constraints=CONSTRAINTS),
    st.builds(t.CharacterString, st.sampled_from(["IA5String", "NumericString"]), constraints=CONSTRAINTS),
    st.builds(t.ObjectIdentifier, st.booleans()),
    st.builds(t.Enumerated, NAMED),
    st.builds(t.Enumerated, NAMED, st.just(True), NAMED),
    st.builds(t.ClassField, REFERENCES, REFERENCES, constraints=CONSTRAINTS),
    st.builds(t.OpenType, REFERENCES, REFERENCES, NAMES),
    REFERENCES,
)


def structures(inner: st.SearchStrategy[t.Type]) -> st.SearchStrategy[t.Type]:
    units = st.none() | st.text(max_size=6)
    components = st.builds(t.Component, NAMES, inner, st.booleans(), DEFAULTS, units)
    some = st.lists(components, max_size=3).map(tuple)
    groups = st.builds(t.Group, some, st.none() | st.integers(2, 9))
    additions = st.lists(components | groups, max_size=3).map(tuple)
    return st.one_of(
        st.builds(t.SequenceOf, inner, st.booleans(), constraints=CONSTRAINTS),
        st.builds(t.Sequence, some, constraints=CONSTRAINTS),
        st.builds(t.Sequence, some, st.just(True), additions, some, constraints=CONSTRAINTS),
        st.builds(t.Choice, some, st.just(True), additions),
    )


@settings(max_examples=40)  # making a type is slow, not the text
@given(type_=st.recursive(LEAVES, structures, max_leaves=4), unit=st.none() | st.text(max_size=6))
def test_any_type_comes_back_as_it_was(type_: t.Type, unit: str | None) -> None:
    module = t.Module("r1_x", "X", "", "s", "f", "0", {"A": t.Definition("A", type_, unit)})
    assert load(dump(module)) == module
