"""Values made from the schema: everything that the schema has occurs, nothing that it has not, and the same every time."""

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import pytest

from asn1.model import types as t
from tests.asn1.imported import snippet
from tests.asn1.ranges import unfold
from tests.asn1.reach import components
from tests.asn1.reference import Encoder
from tests.asn1.truth import schema
from tests.asn1.values import Values


def some(text: str, count: int = 400, seed: int = 1, **options: bool) -> list[Any]:
    values = Values(*snippet(text, "Root"), seed, **options)
    return [values.value() for _ in range(count)]


def test_the_same_seed_gives_the_same_values_and_another_seed_others():
    text = "Root ::= SEQUENCE { a INTEGER (0..1000000), b UTF8String OPTIONAL, ... }"
    assert some(text) == some(text)
    assert some(text) != some(text, seed=2)


def test_both_ends_of_every_range_occur_and_nothing_between_the_ranges():
    values = set(some("Root ::= INTEGER { special(50) } (0..3 | 40..1000)"))
    assert {0, 3, 40, 50, 1000} <= values
    assert all(0 <= one <= 3 or 40 <= one <= 1000 for one in values)


def test_what_an_extension_lets_through_occurs():
    assert {-1, 4} <= set(some("Root ::= INTEGER (0..3, ...)"))
    assert set(some("Root ::= INTEGER (0..3, ..., 9)")) == {0, 1, 2, 3, 9}


def test_numbers_without_bounds_stay_within_64_bits():
    values = set(some("Root ::= INTEGER"))
    assert {-(1 << 63), 0, (1 << 63) - 1} <= values
    assert all(-(1 << 63) <= one < 1 << 63 for one in values)


def test_every_item_and_alternative_occurs():
    assert set(some("Root ::= ENUMERATED { a, b, ..., c, d }", knows_more=False)) == {"a", "b", "c", "d"}
    chosen = some("Root ::= CHOICE { a NULL, ..., b NULL, [[ c NULL, d NULL ]] }", knows_more=False)
    assert {name for name, _ in chosen} == {"a", "b", "c", "d"}


@pytest.mark.parametrize("of", ["OCTET STRING (SIZE (%s))", "IA5String (SIZE (%s))", "SEQUENCE (SIZE (%s)) OF NULL"])
def test_least_and_greatest_sizes_occur_and_those_that_an_extension_lets_through(of: str):
    assert {len(one) for one in some(f"Root ::= {of % '2..5'}")} == {2, 3, 4, 5}
    assert {1, 2, 5, 6} <= {len(one) for one in some(f"Root ::= {of % '2..5, ...'}")}
    assert {len(one) for one in some(f"Root ::= {of % '2..5, ..., 9'}", count=4000)} == {2, 3, 4, 5}


def test_lengths_around_the_fragments_occur_where_they_are_asked_for():
    text = "Root ::= OCTET STRING"
    assert {16383, 16384, 65536} <= {len(one) for one in some(text, count=60_000)}
    assert max(len(one) for one in some(text, count=2000, is_long=False)) == 256


def test_optional_components_are_there_and_not_in_all_ways():
    ways = {
        tuple(sorted(one))
        for one in some("Root ::= SEQUENCE { a NULL OPTIONAL, ..., b NULL, [[ c NULL, d NULL OPTIONAL ]] }")
    }
    assert {(), ("a",), ("b",), ("c",), ("c", "d"), ("a", "b", "c", "d")} <= ways
    assert not any("d" in way and "c" not in way for way in ways)


def test_a_default_that_is_left_out_is_put_in_when_the_value_is_completed():
    values = Values(*snippet("Root ::= SEQUENCE { a INTEGER (0..9) DEFAULT 4 }", "Root"), 1)
    shapes = set()
    for _ in range(100):
        value = values.value()
        shapes.add("a" in value)
        was = dict(value)
        values.complete()
        assert value == {"a": 4, **was}
    assert shapes == {True, False}


def test_trailing_zeros_of_named_bits_make_up_the_least_size_alone():
    for octets, bits in some("Root ::= BIT STRING { a(0) } (SIZE (2..9))"):
        assert bits == 2 or octets[-1] >> (-bits % 8) & 1
        assert len(octets) == (bits + 7) // 8


def test_an_open_type_holds_the_type_that_its_identifier_announces():
    rows = """
        C ::= CLASS { &id Id UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }
        Id ::= INTEGER (0..9)
        Rows C ::= { { BOOLEAN IDENTIFIED BY 1 } | { Name IDENTIFIED BY 2 }, ... }
        Name ::= IA5String (SIZE (1))
        Root ::= SEQUENCE { id C.&id ({Rows}), value C.&Type ({Rows}{@id}) }
    """
    kinds = defaultdict(set)
    for one in some(rows):
        kinds[one["id"]].add(type(one["value"]))
    assert (kinds[1], kinds[2]) == ({bool}, {str})
    assert all(kind == {bytes} for id_, kind in kinds.items() if id_ not in (1, 2))
    assert len(kinds) > 2


def test_what_only_a_newer_sender_knows_is_told():
    values = Values(*snippet("Root ::= SEQUENCE { ..., a NULL OPTIONAL, b NULL OPTIONAL }", "Root"), 1)
    told = 0
    for _ in range(2000):
        value = values.value()
        unknown = [key for key in value if key[0] == "["]
        assert bool(unknown) == values.has_newer
        told += values.has_newer
        if unknown:
            indices = [int(key[1:-1]) for key in unknown if key != "[]"]
            assert all(2 <= index < value["[]"] for index in indices)
    assert told > 20


def test_a_type_that_holds_itself_comes_to_an_end():
    text = "Root ::= SEQUENCE { next Root OPTIONAL, more SEQUENCE OF Root, one CHOICE { a NULL, b Root } }"
    assert 5 < max(map(depth, some(text))) < 20


@pytest.mark.parametrize("name", sorted(schema().messages))
def test_every_value_of_a_message_can_be_encoded_and_none_is_larger_than_it_should(name: str):
    pdu = schema().messages[name].pdu
    values, encoder = Values(schema(), pdu, 1, is_long=False), Encoder(schema())
    assert max(len(encoder.encode(pdu, values.value())) for _ in range(60)) < 12_000


@pytest.mark.parametrize("name", ["cam-1.4.1", "denm-1.3.1", "vam-2.3.1"])
def test_hardly_an_alternative_item_or_component_of_a_message_is_left_out(name: str):
    pdu = schema().messages[name].pdu
    values = Values(schema(), pdu, 1, knows_more=False)
    seen: set[tuple[str, str]] = set()
    for _ in range(1500):
        seen.update(parts(schema(), pdu, values.value()))
    missing = all_parts(schema(), pdu) - seen
    assert len(missing) < len(all_parts(schema(), pdu)) / 25, missing


def parts(schema: t.Schema, type_: t.Type, value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Items, alternatives and components that occur, each with the type that it is of."""
    base, _ = unfold(schema, type_)
    path = type_.name if isinstance(type_, t.Reference) else path
    match base:
        case t.Enumerated():
            yield path, value
        case t.SequenceOf():
            for one in value:
                yield from parts(schema, base.element, one, path)
        case t.Choice() | t.Sequence():
            pairs = [value] if isinstance(base, t.Choice) else value.items()
            types = {one.name: one.type for one in components(base)}
            for name, content in pairs:
                yield path, name
                if not isinstance(types[name], t.OpenType):
                    yield from parts(schema, types[name], content, f"{path}.{name}")


def all_parts(schema: t.Schema, pdu: t.Type) -> set[tuple[str, str]]:
    found: set[tuple[str, str]] = set()
    waiting: list[tuple[t.Type, str]] = [(pdu, "")]
    passed: set[str] = set()
    while waiting:
        type_, path = waiting.pop()
        base, _ = unfold(schema, type_)
        path = type_.name if isinstance(type_, t.Reference) else path
        if isinstance(type_, t.Reference) and path in passed:
            continue
        passed.add(path)
        match base:
            case t.Enumerated():
                found |= {(path, one.name) for one in (*base.root, *base.additions)}
            case t.SequenceOf():
                waiting.append((base.element, path))
            case t.Choice() | t.Sequence():
                found |= {(path, one.name) for one in components(base)}
                waiting += [(one.type, f"{path}.{one.name}") for one in components(base)]
    return found


def depth(value: Any) -> int:
    if isinstance(value, dict):
        return 1 + max(map(depth, value.values()))
    return 1 + max(map(depth, value), default=0) if isinstance(value, list | tuple) else 0
