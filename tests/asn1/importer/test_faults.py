"""Errors of the importer: file, line, construct and clause, all at once."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asn1.importer.parser.fault import ImportFault
from tests.asn1.importing import imported, module, problems
from tests.said import tells

CLASS = "CLS ::= CLASS { &id INTEGER, &Type }  S CLS ::= { ... }"


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("A ::= REAL", "unsupported: REAL (X.680 21)"),
        ("A ::= SET { a NULL }", "unsupported: SET (X.680 27)"),
        ("A ::= BMPString", "unsupported: BMPString (X.680 41)"),
        ("A ::= BMPString (SIZE(2))", "unsupported: BMPString (X.680 41)"),
        ("A ::= ANY DEFINED BY a", "unsupported: ANY (X.680 17)"),
        ("A ::= SEQUENCE { a NULL DEFAULT NULL }", "unsupported: DEFAULT of NULL; make it OPTIONAL (X.680 25.9)"),
        ("A ::= GeneralizedTime", "unsupported: GeneralizedTime (X.680 46)"),
        ("A ::= UTF8String (PATTERN \"x\")", "unsupported: PATTERN (X.680 51.9)"),
        ("A ::= OCTET STRING (CONSTRAINED BY {})", "unsupported: CONSTRAINED (X.682 9)"),
        ("A ::= INTEGER (0..5, ... ! 3)", "unsupported: exception identifier (X.680 53)"),
        ("A ::= INTEGER (1.5)", "unsupported: REAL value (X.680 21)"),
        ("A ::= INSTANCE OF B", "unsupported: INSTANCE (X.680 17)"),
        ("A ::= SEQUENCE OF a NULL", "unsupported: list with a named element (X.680 26.1)"),
        ("A ::= B", "B is neither defined nor imported"),
        ("A ::= INTEGER (0..b)", "b is neither defined nor imported"),
        ("A ::= INTEGER (5..2)", "the range 5..2 is empty (X.680 51.4)"),
        ("A ::= IA5String (\"abc\")", "this constraint cannot be on IA5String (X.680 51.1)"),
        ("A ::= INTEGER (SIZE(2))", "this constraint cannot be on INTEGER (X.680 51.1)"),
        ("A ::= OCTET STRING (0..5)", "this constraint cannot be on OCTET STRING (X.680 51.1)"),
        ("A ::= SEQUENCE OF BIT STRING (FROM(\"a\"))", "this constraint cannot be on BIT STRING (X.680 51.1)"),
        ("A ::= UTF8String (CONTAINING NULL)", "this constraint cannot be on UTF8String (X.680 51.1)"),
        ("A ::= INTEGER ('00'H)", "unsupported: constraint with values that are not numbers (X.680 51.2)"),
        ("A ::= SEQUENCE { a NULL, a NULL }", "two components are called a (X.680 25.11)"),
        ("A ::= CHOICE { a [1] NULL, b [1] NULL }", "two alternatives have the same tag (X.680 29.3)"),
        ("A ::= ENUMERATED { a(1), b(1) }", "two items of an ENUMERATED are the same (X.680 20.4)"),
        ("A ::= ENUMERATED { a, ..., b(5), c(2) }", "c: values of additions must ascend (X.680 20.5)"),
        ("A ::= SEQUENCE { a NULL } (WITH COMPONENTS {b ABSENT})", "unknown component b (X.680 51.8.5)"),
        ("A ::= INTEGER (WITH COMPONENT (1))", "invalid: WITH COMPONENT of a type that is not a list (X.680 51.8.3)"),
        ("A ::= SEQUENCE { a BOOLEAN DEFAULT { } }", "unsupported: DEFAULT of this type (X.680 25.9)"),
        ("A ::= A", "invalid: a type that is defined as itself (X.680 3.8.41)"),
        ("A ::= SEQUENCE { a CLS.&Type } CLS ::= CLASS { &id INTEGER, &Type }", "unsupported: open type without a table constraint (X.682 10)"),
        ("A ::= CLS.&id({S}) CLS ::= CLASS { &a INTEGER, &b INTEGER } S CLS ::= {...}", "CLS has no field &id (X.681 14)"),
        ("A ::= IA5String (FROM(\"\"))", "invalid: alphabet without characters (X.680 51.7)"),
        ("A ::= INTEGER (TRUE)", "TRUE is neither defined nor imported"),
        ("A ::= BIT STRING { a(3), b(3) }", "a(3): duplicate name or number (X.680 22)"),
        ("A ::= INTEGER { a(3), a(4) }", "a(3): duplicate name or number (X.680 19)"),
        ("A ::= CHOICE {}", "invalid: CHOICE without alternatives (X.680 29.1)"),
        ("A ::= CHOICE { ... }", "invalid: CHOICE without alternatives (X.680 29.1)"),
        ("A ::= BIT STRING { far(99999999) }", "out of range: bit outside of 0..65535 (X.680 22.4)"),
        ("A ::= SEQUENCE { a ENUMERATED {x} DEFAULT v } v INTEGER ::= 9", "no item has the number 9 (X.680 20)"),
        (f"A ::= CLS.&Type({{S}}{{@a}}) {CLASS}", "unsupported: open type outside a SEQUENCE (X.682 10.7)"),
        (f"A ::= SEQUENCE OF CLS.&Type({{S}}{{@a}}) {CLASS}", "unsupported: open type outside a SEQUENCE (X.682 10.7)"),
        (f"A ::= CHOICE {{ a CLS.&Type({{S}}{{@a}}) }} {CLASS}", "unsupported: open type outside a SEQUENCE (X.682 10.7)"),
        (f"A ::= SEQUENCE {{ a NULL, b CLS.&Type({{S}}{{@a}}) }} {CLASS}", "b: a has no field of the same class and object set (X.682 10.8)"),
        (f"A ::= SEQUENCE {{ a CLS.&id({{S}}) OPTIONAL, b CLS.&Type({{S}}{{@a}}) }} {CLASS}", "b: a, which selects its type, is OPTIONAL or comes after it (X.682 10.8)"),
        (f"A ::= SEQUENCE {{ a CLS.&id({{S}}) DEFAULT 1, b CLS.&Type({{S}}{{@a}}) }} {CLASS}", "b: a, which selects its type, is OPTIONAL or comes after it (X.682 10.8)"),
        (f"A ::= SEQUENCE {{ b CLS.&Type({{S}}{{@a}}), ..., a CLS.&id({{S}}) }} {CLASS}", "b: a, which selects its type, is OPTIONAL or comes after it (X.682 10.8)"),
        (f"A ::= SEQUENCE {{ c NULL, ..., a CLS.&id({{S}}), b CLS.&Type({{S}}{{@a}}) }} {CLASS}", "b: a, which selects its type, is OPTIONAL or comes after it (X.682 10.8)"),
        (f"A ::= SEQUENCE {{ b CLS.&Type({{S}}{{@a}}), a CLS.&id({{S}}) }} {CLASS}", "b: a, which selects its type, is OPTIONAL or comes after it (X.682 10.8)"),
        ("A ::= INTEGER (0..5", "expected ')', found 'END' (X.680 49.6)"),
        ("A ::= INTEGER ~", "invalid character '~' (X.680 12)"),
        ("A ::= INTEGER /* for ever", "comment without end (X.680 12.6.4)"),
        ("A ::= NULL\nA ::= NULL", "A is defined twice (X.680 13.3)"),
    ],
)  # fmt: skip
def test_a_construct_that_is_not_imported_is_named_with_its_place(body: str, problem: str) -> None:
    lines = problems(module(body))
    assert lines[0].removeprefix("m.asn:2: ").removeprefix("m.asn:3: ") == problem


def test_problems_of_a_text_are_reported_at_once_in_the_order_of_the_lines() -> None:
    text = module("A ::= SEQUENCE { b B, c C, d D }\nB ::= REAL\nC ::= SET {}\nD ::= E\nF ::= REAL")
    *unsupported, undefined = problems(text)
    assert unsupported == ["m.asn:3: unsupported: REAL (X.680 21)", "m.asn:4: unsupported: SET (X.680 27)"]
    assert tells(undefined, "m.asn:5: E ", "defined", "imported")


def test_every_unsupported_component_is_told_though_they_stand_in_one_type() -> None:
    text = module("A ::= SEQUENCE {\na REAL,\nb SET {},\nc SEQUENCE { d ANY },\n..., e BMPString (SIZE(2)),\n[[ f B ]] }\n"
                  "B ::= BMPString (SIZE(1))", imports="IMPORTS C FROM Nowhere;")  # fmt: skip
    assert problems(text) == [
        "m.asn:3: unsupported: REAL (X.680 21)",
        "m.asn:4: unsupported: SET (X.680 27)",
        "m.asn:5: unsupported: ANY (X.680 17)",
        "m.asn:6: unsupported: BMPString (X.680 41)",
        "m.asn:8: unsupported: BMPString (X.680 41)",
    ]


def test_reading_goes_on_behind_what_cannot_be_read() -> None:
    text = module("A ::= SEQUENCE { 5 }\nB ::= NULL\nC ::= INTEGER (0..)\nD { X } ::= NULL ;")
    assert [line.split(":")[1] for line in problems(text)] == ["2", "4", "5"]


def test_an_import_from_a_module_that_is_not_there_names_the_line_of_the_import() -> None:
    text = module("A ::= B", imports="IMPORTS\nB\nFROM Nowhere {1 2};")
    assert problems(text) == ["m.asn:3: no module Nowhere to import B from"]


def test_text_without_a_module_is_refused() -> None:
    (why,) = problems("-- only a comment")
    assert tells(why, "m.asn:1: ", "no module", "(X.680 13.1)")


def test_deep_nesting_ends_in_a_fault() -> None:
    assert problems(module("A ::= " + "SEQUENCE OF " * 5000 + "NULL")) == ["m.asn:2: nested deeper than 60"]
    assert problems(module("A ::= INTEGER " + "(" * 5000)) == ["m.asn:2: nested deeper than 60"]


def test_a_template_without_end_ends_in_a_fault() -> None:
    text = module("A ::= T { NULL }\nT { X } ::= SEQUENCE { a T { SEQUENCE OF X } OPTIONAL }")
    assert problems(text) == ["m.asn:3: endless instances of T (X.683 9)"]


@pytest.mark.parametrize(
    "body",
    [
        "A ::= INTEGER (0..a)  a INTEGER ::= b  b INTEGER ::= a",
        "A ::= INTEGER (0..a)  a INTEGER ::= a",
        "A ::= INTEGER { a(b) }  b A ::= a",
        "A ::= SEQUENCE { a B DEFAULT b }  B ::= BOOLEAN  b B ::= c  c B ::= b",
        "A ::= INTEGER (B)  B ::= INTEGER (A)",
        "A ::= SEQUENCE { COMPONENTS OF A }",
        "A ::= CHOICE { a B, b [0] NULL }  B ::= CHOICE { b [1] A, c A }",
        "A ::= C.&id({S})  C ::= CLASS { &id INTEGER, &Type }  S C ::= { T }  T C ::= { S }",
    ],
)
def test_what_leads_back_to_itself_ends_in_a_fault(body: str) -> None:
    text = module(body, tags="EXPLICIT TAGS" if "CHOICE" in body else "AUTOMATIC TAGS")
    assert {line.split(": ")[1] for line in problems(text)} == {"circular definition"}


def test_a_number_of_thousands_of_digits_ends_in_a_fault() -> None:
    assert problems(module(f"A ::= INTEGER (0..{'9' * 9999})")) == ["m.asn:2: a number of 9999 digits"]


WORDS = [
    "A",
    "B",
    "CLS",
    "M",
    "a",
    "b",
    "x",
    "0",
    "7",
    "::=",
    "...",
    "..",
    "[[",
    "]]",
    "[",
    "]",
    "{",
    "}",
    "(",
    ")",
    ",",
    ";",
    ":",
    "|",
    "^",
    "@",
    ".",
    "!",
    "<",
    "-",
    "BEGIN",
    "END",
    "DEFINITIONS",
    "AUTOMATIC",
    "TAGS",
    "IMPORTS",
    "FROM",
    "SEQUENCE",
    "CHOICE",
    "SET",
    "OF",
    "SIZE",
    "INTEGER",
    "BIT",
    "STRING",
    "OCTET",
    "ENUMERATED",
    "NULL",
    "OPTIONAL",
    "DEFAULT",
    "WITH",
    "COMPONENT",
    "COMPONENTS",
    "PRESENT",
    "ALL",
    "EXCEPT",
    "CONTAINING",
    "CLASS",
    "&id",
    "&Type",
    "SYNTAX",
    "IDENTIFIED",
    "BY",
    "UNIQUE",
    "MIN",
    "MAX",
    "TRUE",
    "'01'B",
    "'AF'H",
    '"text"',
    "--",
    "/*",
    "*/",
]


@given(text=st.lists(st.sampled_from([*WORDS, "\n"]), max_size=60).map(" ".join))
def test_words_in_any_order_are_taken_or_refused_cleanly(text: str) -> None:
    try:
        imported(module(text))
    except ImportFault as error:
        assert all(problem.place.line >= 1 for problem in error.problems)


@given(text=st.text(max_size=200))
def test_any_text_is_taken_or_refused_cleanly(text: str) -> None:
    for whole in (text, module(text), module("A ::= " + text)):
        try:
            imported(whole)
        except ImportFault as error:
            assert error.problems


SEED = """A ::= SEQUENCE { a [0] B (0..n | 9, ...) DEFAULT 1, ..., [[ 2: b C OPTIONAL ]], c CHOICE { d NULL }, ..., e T {{S}} }
B ::= INTEGER { x(1) } (MIN..7)
C ::= SEQUENCE SIZE(1..4) OF D (WITH COMPONENTS {..., p (x), q ABSENT})
D ::= SEQUENCE { p B, q ENUMERATED { r(3), s, ..., t } OPTIONAL, COMPONENTS OF E }
E ::= SEQUENCE { u OCTET STRING (CONTAINING B) OPTIONAL, v IA5String (FROM("a".."z"))(SIZE(2)), w U { B, 5 } }
T {CLS : Set} ::= SEQUENCE { k CLS.&id({Set}), v CLS.&Type({Set}{@k}) }
U { Type, INTEGER : size } ::= SEQUENCE (SIZE(size)) OF Type
CLS ::= CLASS { &id B UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }
S CLS ::= { {C IDENTIFIED BY x} | {NULL IDENTIFIED BY 2}, ... }
n B ::= 5"""
SEED_WORDS = [word + " " for word in re.findall(r'"[^"]*"|[\w&-]+|::=|\.{2,3}|\[\[|\]\]|\n|\S', SEED)]


def test_the_seed_of_damaged_texts_is_right() -> None:
    assert [*imported(module("".join(SEED_WORDS)))["m"].definitions] == ["A", "B", "C", "D", "T-S", "U-B-5"]


@given(
    at=st.integers(0, len(SEED_WORDS)),
    cut=st.integers(0, 4),
    words=st.lists(st.sampled_from(SEED_WORDS), max_size=3),
    more=st.integers(0, len(SEED_WORDS)),
)
def test_a_damaged_text_is_taken_or_refused_cleanly(at: int, cut: int, words: list[str], more: int) -> None:
    damaged = SEED_WORDS[:at] + words + SEED_WORDS[at + cut :]
    del damaged[more : more + 1]
    try:
        imported(module("".join(damaged)))
    except ImportFault as error:
        assert error.problems
