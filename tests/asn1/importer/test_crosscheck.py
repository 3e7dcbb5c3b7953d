"""asn1tools reads every text as well: where its tree can tell, a difference stops the import with its place."""

import dataclasses
from typing import Any

import pytest

from asn1.importer.crosscheck import crosscheck
from asn1.importer.parser import syntax
from asn1.importer.parser.fault import ImportFault
from asn1.importer.parser.module_parser import parse
from tests.asn1.importing import module
from tests.said import tells

TEXT = module(
    """A ::= SEQUENCE { a B OPTIONAL, b INTEGER { x(1) } (0..9|11, ...), ..., [[ c C, d D ]], e T {{S}} DEFAULT 1, ..., f NULL }
B ::= CHOICE { a [0] BOOLEAN, b [1] SET OF NULL, ... }
C ::= ENUMERATED { one(1), two, ..., nine(9) }
D ::= SEQUENCE SIZE(1..4) OF OCTET STRING (SIZE(n))
T {CLS : Set} ::= SEQUENCE { k CLS.&id({Set}), v CLS.&Type({Set}{@k}), COMPONENTS OF E }
E ::= SEQUENCE { r RELATIVE-OID }
CLS ::= CLASS { &id INTEGER, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }
S CLS ::= { {NULL IDENTIFIED BY 1}, ... }
F ::= D (SIZE(1..2), ...)
G ::= BIT STRING { p(0) } (SIZE(1..8))
n INTEGER ::= 5""",
    imports="IMPORTS X, Y{} FROM N;",
)


def test_what_both_read_alike_passes() -> None:
    assert crosscheck(TEXT, "m.asn", parse(TEXT, "m.asn")) is None


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        ("one(1)", "won(1)", "4: the items of C: we read"),
        ("nine(9)", "nine(8)", "4: the number of C.nine: we read 9, asn1tools 8"),
        ("a B OPTIONAL", "a B", "2: OPTIONAL of A.a: we read True, asn1tools False"),
        ("DEFAULT 1", "", "2: DEFAULT of A.e: we read True, asn1tools False"),
        ("a B", "a C", "2: the type of A.a: we read B, asn1tools C"),
        ("c C, d D", "d D, c C", "2: the name of A.c: we read c, asn1tools d"),
        ("[[ c C, d D ]]", "c C, d D", "2: the number of members of A: we read 7, asn1tools 8"),
        ("0..9|11", "0..9|12", "2: the range of A.b: we read [(0, 9), 11, None], asn1tools [(0, 9), 12, None]"),
        ("SIZE(1..4)", "SIZE(1..3)", "5: the range of D: we read [(1, 4)], asn1tools [(1, 3)]"),
        ("x(1)", "x(2)", "2: the names of A.b: we read [('x', '1')], asn1tools [('x', '2')]"),
        ("p(0)", "q(0)", "11: the names of G: we read [('p', '0')], asn1tools [('q', '0')]"),
        ("COMPONENTS OF E", "COMPONENTS OF F", "6: COMPONENTS OF in T: we read E, asn1tools F"),
        ("&id INTEGER", "&ix INTEGER", "8: fields of CLS: we read"),
        ("F ::= D", "H ::= D", "1: names of TypeAssignment: we read"),
        ("n INTEGER ::= 5", "n BOOLEAN ::= TRUE", "12: type of n: we read INTEGER, asn1tools BOOLEAN"),
        ("IMPORTS X,", "IMPORTS Z,", "1: imports: we read"),
        ("M DEFINITIONS", "O DEFINITIONS", "1: module M: we read there, asn1tools not there"),
    ],
)
def test_what_it_reads_otherwise_is_told_with_its_line(before: str, after: str, problem: str) -> None:
    assert before in TEXT
    with pytest.raises(ImportFault) as error:
        crosscheck(TEXT.replace(before, after, 1), "m.asn", parse(TEXT, "m.asn"))
    assert any(line.startswith(f"m.asn:{problem}") for line in str(error.value).splitlines())


def test_text_that_asn1tools_cannot_read_is_not_compared_and_noted_with_its_line() -> None:
    note = crosscheck(TEXT.replace("B ::= CHOICE", "B ::= CHOOSE"), "m.asn", parse(TEXT, "m.asn"))
    assert tells(str(note), "m.asn:3: ", "not compared: ", "asn1tools")


def test_what_breaks_it_is_not_compared_and_that_is_said() -> None:
    text = module("A ::= SEQUENCE { a INTEGER DEFAULT n }  n INTEGER ::= 5")
    assert str(crosscheck(text, "m.asn", parse(text, "m.asn"))).startswith(
        "m.asn:1: not compared: asn1tools stops with"
    )


def test_an_optional_that_we_lose_would_be_seen() -> None:
    (ours,) = parse(TEXT, "m.asn")
    changed = _without_optional(ours)
    with pytest.raises(ImportFault, match=r"OPTIONAL of A\.a: we read False, asn1tools True"):
        crosscheck(TEXT, "m.asn", [changed])


def _without_optional(ours: syntax.Module) -> syntax.Module:
    assignment: Any = ours.assignments["A"]
    members = assignment.type.members
    first = dataclasses.replace(members.root[0], is_optional=False)
    type_ = dataclasses.replace(assignment.type, members=dataclasses.replace(members, root=(first, *members.root[1:])))
    return dataclasses.replace(ours, assignments={**ours.assignments, "A": dataclasses.replace(assignment, type=type_)})
