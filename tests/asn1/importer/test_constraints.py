"""Constraints: ranges, sizes, alphabets, inner types, in the nesting of the text."""

import pytest

from asn1.importer.resolver.sets import merged
from asn1.model import types as t
from tests.asn1.importing import definition, limited, ref, values


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(5)", limited(5)),
        ("(MIN..MAX)", limited((None, None))),
        ("(-3..MAX, ...)", limited((-3, None), extensible=True)),
        ("(0..5, ..., 7)", t.Constraint(values((0, 5)), True, values(7))),
        ("(1 | 3..4 | 2)", limited((1, 4))),
        ("(9 | 1..3)", limited((1, 3), 9)),
        ("(0<..<5)", limited((1, 4))),
        ("((1..3) UNION 5)", limited((1, 3), 5)),
        ("(1..9 ^ 5..20)", t.Constraint(t.AllOf((values((1, 9)), values((5, 20)))))),
        ("(1..9 EXCEPT 5)", t.Constraint(t.AllOf((values((1, 9)), t.AllExcept(values(5)))))),
        ("(ALL EXCEPT 1)", t.Constraint(t.AllExcept(values(1)))),
    ],
)
def test_a_constraint_of_numbers(text: str, expected: t.Constraint) -> None:
    assert definition(f"A ::= INTEGER {text}").constraints == (expected,)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("OCTET STRING (SIZE(2))", limited(2)),
        ("SEQUENCE (SIZE(1..4, ...)) OF NULL", limited((1, 4), extensible=True)),
        ("SEQUENCE SIZE(1..n) OF NULL", limited((1, 6))),
        ("BIT STRING (SIZE(1 | 5))", limited(1, 5)),
    ],
)
def test_a_size(text: str, expected: t.Constraint) -> None:
    assert definition(f"A ::= {text}  n INTEGER ::= 6").constraints == (t.Constraint(t.Size(expected)),)


def test_an_ellipsis_behind_a_size_is_not_one_in_it() -> None:
    found = definition("A ::= SEQUENCE (SIZE(1..4), ...) OF NULL")
    assert found.constraints == (t.Constraint(t.Size(limited((1, 4))), is_extensible=True),)


def test_a_constraint_behind_of_is_the_elements() -> None:
    found = definition("A ::= SEQUENCE (SIZE(2)) OF INTEGER (0..7)")
    assert isinstance(found, t.SequenceOf)
    assert found.element.constraints == (limited((0, 7)),)
    assert found.constraints == (t.Constraint(t.Size(limited(2))),)


def test_an_alphabet_is_code_points() -> None:
    found = definition('A ::= IA5String (FROM("a".."c" | "xzy")) (SIZE(1..5))')
    alphabet = t.Alphabet(limited((97, 99), (120, 122)))
    assert found.constraints == (t.Constraint(alphabet), t.Constraint(t.Size(limited((1, 5)))))


def test_named_numbers_count_inside_constraints_of_components() -> None:
    body = "A ::= H (WITH COMPONENTS {..., version(2), id(cam)})  H ::= SEQUENCE { version INTEGER, id I }"
    found = definition(body + " I ::= INTEGER { denm(1), cam(2) } (0..255)")
    lines = (t.InnerComponent("version", limited(2), None), t.InnerComponent("id", limited(2), None))
    assert found == ref("H", "m", t.Constraint(t.Inner(True, lines)))


def test_names_of_the_governing_type_come_before_values_of_the_module() -> None:
    # X.680 19.10
    body = "A ::= INTEGER { one(1) } (one..two)  one INTEGER ::= 100  two INTEGER ::= 2"
    assert definition(body).constraints == (limited((1, 2)),)


def test_items_of_an_enumeration_are_their_numbers() -> None:
    assert definition("A ::= B (y | z)  B ::= ENUMERATED { x, y, z }").constraints == (limited((1, 2)),)


def test_presence_nests() -> None:
    body = "A ::= B (WITH COMPONENTS {a (WITH COMPONENTS {..., c ABSENT}), b PRESENT, d OPTIONAL, e})"
    body += " B ::= SEQUENCE { a C OPTIONAL, b NULL OPTIONAL, ..., [[ d NULL, e NULL OPTIONAL ]] }"
    found = definition(body + " C ::= SEQUENCE { c NULL OPTIONAL }")
    inside = t.Constraint(t.Inner(True, (t.InnerComponent("c", None, "ABSENT"),)))
    assert found.constraints == (
        t.Constraint(
            t.Inner(
                False,
                (
                    t.InnerComponent("a", inside, None),
                    t.InnerComponent("b", None, "PRESENT"),
                    t.InnerComponent("d", None, "OPTIONAL"),
                    t.InnerComponent("e", None, None),
                ),
            )
        ),
    )


def test_an_included_type_brings_its_constraints_without_its_ellipsis() -> None:
    # X.680 51.3.3
    assert definition("A ::= INTEGER (B)  B ::= INTEGER (1..5, ...)").constraints == (limited((1, 5)),)
    assert definition("A ::= INTEGER (INCLUDES C)  C ::= B (2..9)  B ::= INTEGER (1..5)").constraints == (
        t.Constraint(t.AllOf((values((1, 5)), values((2, 9))))),
    )


def test_ranges_merge_where_they_touch() -> None:
    ranges = [t.Range(5, 6), t.Range(None, 1), t.Range(2, 3), t.Range(6, None)]
    assert merged(ranges) == (t.Range(None, 3), t.Range(5, None))
