"""The nine ways in which asn1tools' tree tells less than the text: ours tells it.

Each test shows what asn1tools gives for the text, so that the day it gets better is seen here.
"""

from typing import Any

import asn1tools  # type: ignore[import-untyped]
import pytest

from asn1.model import types as t
from tests.asn1.importing import definition, imported, limited, module, ref, values

CLASS = "CLS ::= CLASS { &id Id UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }  Id ::= INTEGER (0..255)"
TEMPLATE = "T {CLS : Set} ::= SEQUENCE { key CLS.&id({Set}), value CLS.&Type({Set}{@key}) }"


def tree(text: str) -> dict[str, Any]:
    """asn1tools' tree of the first module."""
    trees: dict[str, dict[str, Any]] = asn1tools.parse_string(text)
    return next(iter(trees.values()))


def test_rows_of_object_sets_are_kept() -> None:
    text = module(f"A ::= T {{{{S}}}} {TEMPLATE} {CLASS} S CLS ::= {{ {{NULL IDENTIFIED BY 1}}, ... }}")
    assert tree(text)["object-sets"]["S"]["members"] == []
    assert imported(text)["m"].sets["S"].rows == (t.ObjectRow(1, t.Null()),)


def test_the_set_of_a_parameterised_reference_is_kept() -> None:
    text = module(f"A ::= SEQUENCE {{ a T {{{{S}}}} }} {TEMPLATE} {CLASS} S CLS ::= {{ ... }}")
    assert tree(text)["types"]["A"]["members"][0]["actual-parameters"] == ["{"]
    assert imported(text)["m"].definitions["A"].type == t.Sequence((t.Component("a", ref("T-S")),))


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("L (WITH COMPONENT (0..3))", t.Element(limited((0, 3)))),
        (
            "S ((WITH COMPONENTS {..., a PRESENT}) | (WITH COMPONENTS {..., a ABSENT}))",
            t.AnyOf(
                (
                    t.Inner(True, (t.InnerComponent("a", None, "PRESENT"),)),
                    t.Inner(True, (t.InnerComponent("a", None, "ABSENT"),)),
                )
            ),
        ),
        ("OCTET STRING (CONTAINING INTEGER (0..9))", t.Contents(t.Integer(constraints=(limited((0, 9)),)))),
        ("INTEGER (ALL EXCEPT 4)", t.AllExcept(values(4))),
        ("INTEGER (INCLUDES I)", values((0, 7))),
    ],
)
def test_constraints_that_asn1tools_drops_are_kept(text: str, kept: t.ElementSet) -> None:
    body = f"A ::= {text}  L ::= SEQUENCE OF I  I ::= INTEGER (0..7)  S ::= SEQUENCE {{ a NULL OPTIONAL }}"
    assert definition(body).constraints == (t.Constraint(kept),)


def test_serial_constraints_and_unions_differ() -> None:
    serial, union = module("A ::= INTEGER (0..10)(2..5)"), module("A ::= INTEGER (0..10|2..5)")
    assert tree(serial)["types"] == tree(union)["types"]
    assert imported(serial)["m"].definitions["A"].type.constraints == (limited((0, 10)), limited((2, 5)))
    assert imported(union)["m"].definitions["A"].type.constraints == (limited((0, 10)),)


def test_a_constraint_on_an_actual_parameter_is_kept() -> None:
    found = imported(module("A ::= T { INTEGER (0..5) }  T { X } ::= SEQUENCE { x X (1..9) }"))["m"].definitions
    instance = found["T-INTEGER-0-5"].type
    assert found["A"].type == ref("T-INTEGER-0-5")
    assert instance == t.Sequence((t.Component("x", t.Integer(constraints=(limited((0, 5)), limited((1, 9))))),))


def test_a_template_inside_an_addition_group_is_expanded() -> None:
    body = "A ::= SEQUENCE { ..., [[ a T { NULL } ]] }  T { X } ::= SEQUENCE { x X }"
    found = imported(module(body))["m"].definitions
    assert found["A"].type == t.Sequence((), True, (t.Group((t.Component("a", ref("T-NULL")),)),))
    assert found["T-NULL"].type == t.Sequence((t.Component("x", t.Null()),))


def test_object_identifiers_are_kept() -> None:
    from asn1.importer.parser.module_parser import parse

    text = "M { itu-t (0) identified-organization(4) 5 } DEFINITIONS ::= BEGIN\nIMPORTS B FROM N {iso (1) x(2)} ;\nEND"
    (found,) = parse(text, "m.asn")
    assert found.oid == "{ itu-t(0) identified-organization(4) 5 }"
    assert found.imports["B"].oid == "{ iso(1) x(2) }"
    assert "oid" not in tree(text)


def test_comments_in_front_of_types_and_components_give_units() -> None:
    body = "/** words\n * @unit: 0,1 metre\n */\nA ::= SEQUENCE {\n/** @unit n/a */ a B,\n-- @unit ms\n b INTEGER }"
    body += "\n/** @unit x */\n-- gone ::= NULL\n/** @brief no unit */ B ::= INTEGER -- @unit y"
    found = imported(module(body))["m"].definitions
    assert found["A"].unit == "0.1 m"
    assert found["B"].unit is None
    assert found["A"].type == t.Sequence(
        (t.Component("a", ref("B")), t.Component("b", t.Integer(), unit="ms")),
    )


@pytest.mark.parametrize(
    ("type_", "default", "theirs", "ours"),
    [
        ("Named", "usual", "usual", 3),
        ("Number", "value", "value", 600),
        ("Flag", "TRUE", "TRUE", True),
    ],
)
def test_a_default_is_followed_to_its_value(type_: str, default: str, theirs: object, ours: object) -> None:
    text = module(
        f"A ::= SEQUENCE {{ a {type_} DEFAULT {default} }}  value INTEGER ::= 600  Flag ::= BOOLEAN "
        "Number ::= INTEGER  Named ::= INTEGER { usual(3) }"
    )
    assert tree(text)["types"]["A"]["members"][0]["default"] == theirs
    found = imported(text)["m"].definitions["A"].type
    assert isinstance(found, t.Sequence)
    assert found.root[0].default == ours


def test_where_an_ellipsis_stands_is_kept() -> None:
    inside, outside = (
        module("A ::= B (SIZE(2..3, ...)) B ::= IA5String"),
        module("A ::= B (SIZE(2..3), ...) B ::= IA5String"),
    )
    assert tree(inside)["types"] == tree(outside)["types"]
    ranges = imported(inside)["m"].definitions["A"].type.constraints
    assert ranges == (t.Constraint(t.Size(limited((2, 3), extensible=True))),)
    ranges = imported(outside)["m"].definitions["A"].type.constraints
    assert ranges == (t.Constraint(t.Size(limited((2, 3))), is_extensible=True),)


def test_every_serial_constraint_keeps_its_own_ellipsis() -> None:
    text = module("A ::= INTEGER (0..9, ...)(1..4)")
    assert tree(text)["types"]["A"]["restricted-to"] == [(0, 9), None, (1, 4)]
    assert imported(text)["m"].definitions["A"].type.constraints == (limited((0, 9), extensible=True), limited((1, 4)))


def test_class_fields_inside_lists_and_choices_are_kept() -> None:
    body = "A ::= CHOICE { list SEQUENCE OF CLS.&id({S}), relative RELATIVE-OID }"
    found = definition(f"{body} {CLASS} S CLS ::= {{ ... }}")
    assert found == t.Choice(
        (
            t.Component("list", t.SequenceOf(t.ClassField(ref("CLS"), ref("S")))),
            t.Component("relative", t.ObjectIdentifier(is_relative=True)),
        )
    )
