"""Layouts: which nodes there are, what they are called, how wide they are and what lies behind pointers."""

import math

import pytest

from asn1.layout.layout import Kind, Layout, Node, lay_out
from asn1.layout.memory import arena_octets, number_octets
from asn1.layout.widths import is_flat, minimal_bits
from asn1.model.text import load_schema
from tests.asn1.compiled import schema_of


def laid_out(body: str, *names: str) -> Layout:
    schema = schema_of(body, *names)
    return lay_out(schema, [schema.messages[name] for name in names])


def node(body: str) -> Node:
    """Of a module that begins with a type A."""
    return laid_out(body, "A").pdus["A"]


def named(layout: Layout) -> dict[str, Node]:
    return {node.c_name: node for nodes in layout.nodes.values() for node in nodes}


def test_only_what_the_messages_reach_is_laid_out() -> None:
    schema = load_schema()
    names = named(lay_out(schema, [schema.messages["cam-1.4.1"]]))
    assert "r1_cdd_PathHistory" in names
    assert "r1_cdd_ActionID" not in names


def test_a_type_inside_a_type_is_called_by_its_path() -> None:
    names = named(laid_out("A ::= SEQUENCE { b-c SEQUENCE OF CHOICE { d NULL } }", "A"))
    assert set(names) == {"m_A", "m_A_b_c", "m_A_b_c_item", "m_A_b_c_item_d"}


def test_a_path_that_is_taken_gets_an_underscore() -> None:
    names = named(laid_out("A ::= SEQUENCE { b BOOLEAN, c A-b }  A-b ::= NULL", "A"))
    assert {"m_A_b", "m_A_b_"} <= set(names)
    assert names["m_A_b"].kind is Kind.NULL


def test_a_narrowed_number_is_a_node_of_its_own_with_the_name_and_unit_of_its_type() -> None:
    a = node("A ::= SEQUENCE { b B (0..3), c B }  B ::= INTEGER (0..255) -- 0.1 metre")
    narrowed, whole = (f.node for f in a.fields)
    assert (narrowed.bounds.high, whole.bounds.high) == (3, 255)
    assert narrowed.asn_name == whole.asn_name == "B"
    assert narrowed.unit == whole.unit
    assert not narrowed.is_defined


def test_a_narrowed_sequence_keeps_its_node_and_leaves_the_rest_to_validate() -> None:
    a = node("A ::= SEQUENCE { b B (WITH COMPONENTS { ..., c PRESENT }), d B }  B ::= SEQUENCE { c NULL OPTIONAL }")
    assert a.fields[0].node is a.fields[1].node
    assert len(a.fields[0].checks) == 1
    assert not a.fields[1].checks


def test_every_addition_may_be_absent_and_a_group_counts_once() -> None:
    a = node("A ::= SEQUENCE { a NULL, ..., b NULL, [[ c NULL, d NULL OPTIONAL ]], ..., e NULL }")
    assert [(f.name, f.addition, f.is_optional, f.in_group, f.is_mandatory) for f in a.fields] == [
        ("a", 0, False, False, False),
        ("e", 0, False, False, False),
        ("b", 1, True, False, True),
        ("c", 2, True, True, True),
        ("d", 2, True, True, False),
    ]
    assert (a.root_count, a.additions) == (2, 2)


def test_brackets_in_a_choice_do_not_count() -> None:
    a = node("A ::= CHOICE { a NULL, ..., [[ b NULL, c NULL ]], d NULL }")
    assert [f.addition for f in a.fields] == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("type_", "octets", "is_signed"),
    [
        ("INTEGER (0..255)", 1, False),
        ("INTEGER (-1..255)", 2, True),
        ("INTEGER (0..4294967296)", 8, False),
        ("INTEGER (0..1, ...)", 8, True),
        ("INTEGER (0..MAX)", 8, True),
        ("BIT STRING (SIZE(9))", 2, False),
    ],
)
def test_a_number_lies_in_the_smallest_type_that_holds_its_range(type_: str, octets: int, is_signed: bool) -> None:
    assert number_octets(node(f"A ::= {type_}")) == (octets, is_signed)


def test_a_type_inside_itself_lies_behind_a_pointer() -> None:
    a = node("A ::= SEQUENCE { b B OPTIONAL }  B ::= SEQUENCE { a A }")
    assert a.recurs
    assert a.fields[0].is_pointer


def test_a_list_of_itself_needs_no_pointer_of_its_own() -> None:
    a = node("A ::= SEQUENCE { n INTEGER (0..1), list SEQUENCE OF A }")
    assert a.recurs
    assert not a.fields[0].is_pointer


def test_what_is_large_lies_behind_a_pointer_where_it_may_be_absent() -> None:
    body = """A ::= SEQUENCE { there B, perhaps B OPTIONAL, small C OPTIONAL }
    B ::= SEQUENCE { x OCTET STRING (SIZE(64)), y OCTET STRING (SIZE(64)), z BOOLEAN }
    C ::= SEQUENCE { x OCTET STRING (SIZE(64)), y OCTET STRING (SIZE(64)) }"""
    assert [f.is_pointer for f in node(body).fields] == [False, True, False]


def test_a_struct_stands_behind_those_that_lie_in_it() -> None:
    order = list(named(laid_out("A ::= SEQUENCE { b B, c C }  B ::= SEQUENCE { c C }  C ::= SEQUENCE { d NULL }", "A")))
    assert order.index("m_C") < order.index("m_B") < order.index("m_A")


def test_small_sequences_of_numbers_are_flat() -> None:
    assert is_flat(node("A ::= SEQUENCE { a INTEGER (0..1), b B }  B ::= SEQUENCE { c BOOLEAN }"))
    assert not is_flat(node("A ::= SEQUENCE { a INTEGER (0..1) OPTIONAL }"))
    assert not is_flat(node("A ::= SEQUENCE { a INTEGER (0..1), ... }"))
    assert not is_flat(node("A ::= SEQUENCE { a IA5String }"))


@pytest.mark.parametrize(
    ("type_", "bits"),
    [
        ("NULL", 0),
        ("INTEGER (0..7, ...)", 4),
        ("INTEGER", 16),
        ("SEQUENCE { a INTEGER (0..7), b INTEGER (0..7) OPTIONAL, ... }", 5),
        ("CHOICE { a NULL, b INTEGER (0..255) }", 1),
        ("SEQUENCE (SIZE(2..3)) OF INTEGER (0..7)", 7),
        ("SEQUENCE OF INTEGER (0..7)", 8),
        ("IA5String (SIZE(4))", 28),
        ("OCTET STRING (SIZE(2..3, ...))", 9),
    ],
)
def test_no_value_takes_fewer_bits(type_: str, bits: int) -> None:
    assert minimal_bits(node(f"A ::= {type_}"), {}) == bits


def test_the_identifier_of_an_open_type_is_found_beside_it() -> None:
    schema = load_schema()
    names = named(lay_out(schema, [schema.messages["cpm-2.1.1"]]))
    wrapped = names["r2_cpm211_WrappedCpmContainer"]
    content = wrapped.fields[1].node
    assert content.kind is Kind.OPEN
    assert wrapped.fields[content.selector].name == "containerId"
    assert [row for row, _ in content.rows] == [1, 2, 3, 4, 5]


def test_all_messages_of_all_editions_are_laid_out() -> None:
    schema = load_schema()
    layout = lay_out(schema, list(schema.messages.values()))
    assert set(layout.pdus) == set(schema.messages)
    assert len(named(layout)) == sum(map(len, layout.nodes.values()))


def test_the_memory_that_a_message_may_ask_for_is_bounded_by_its_octets() -> None:
    schema = load_schema()
    layout = lay_out(schema, list(schema.messages.values()))
    octets = {name: arena_octets(pdu) for name, pdu in layout.pdus.items()}
    assert octets["rawtx-1"] == 0
    assert octets["cam-1.4.1"] < 100
    assert max(octets.values()) < 1000


def test_memory_is_paid_by_bits_of_its_own() -> None:
    # an element takes 2 octets and with what alignment may cost 9, and brings 9 bits
    assert arena_octets(node("A ::= SEQUENCE OF INTEGER (0..511)")) == 8
    # a struct of 16 octets for each list of it, paid by the 3 bits of its count
    assert arena_octets(node("A ::= SEQUENCE OF SEQUENCE (SIZE(0..7)) OF INTEGER (0..511)")) == math.ceil(
        8 * (16 + 7) / 3
    )
