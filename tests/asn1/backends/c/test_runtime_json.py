"""JSON in and out, text and equality, over types of every kind (tests/asn1/backends/c/runtime/every.c)."""

import functools
import json
from collections.abc import Iterator
from typing import Any

import asn1tools
import pytest

from tests.asn1.walker import Refusal, Walker, build
from tests.said import tells

EVERY: dict[str, Any] = {
    "flag": True, "nothing": None, "small": -10, "wide": 4000000000, "free": -(2**63), "positive": 2**63 - 1, "colour": "green",
    "mask": "A2", "named": {"value": "8040", "length": 10}, "big": "0123456789ABCDEF04", "loose": {"value": "F8", "length": 5},
    "key": "C0FFEE", "data": "0102030405", "name": "a\"\\\u0001", "digits": "1 ", "code": "0A9F", "label": "It's (fine)?",
    "text": "\u00e4\u20ac\U0001f600", "oid": "1.2.840.113549", "arcs": "8571.3.2", "limit": 3, "maybe": 7, "list": [0, 15, 31],
    "nulls": [None, None], "which": {"inner": {"a": 3, "b": False}}, "id": 2, "value": {"a": 1},
}  # fmt: skip


@pytest.fixture(scope="module")
def walker() -> Iterator[Walker]:
    walker = Walker(build())
    yield walker
    walker.close()


def every(**changes: Any) -> str:
    return json.dumps(EVERY | changes, ensure_ascii=False)


def refused(answer: str | Refusal) -> Refusal:
    assert isinstance(answer, Refusal), answer
    return answer


# ---------------------------------------------------------------- what is taken


def test_a_value_of_every_kind_comes_back_as_it_was(walker: Walker) -> None:
    written = walker.json("Every", every())
    assert isinstance(written, str), written
    assert json.loads(written) == EVERY


@pytest.mark.parametrize(
    "change",
    [
        {"next": EVERY | {"next": EVERY}},
        {"which": {"number": 255}},
        {"which": {"extra": True}},
        {"which": {"[2]": "00FF"}},
        {"which": {"blob": "00FF"}},
        {"colour": "blue"},
        {"colour": "[1]"},
        {"first": False},
        {"high": 1},
        {"high": 1, "low": True, "step": 7},
        {"[2]": "", "[16382]": "AA"},
        {"[2]": "01", "[]": 5},
        {"[]": 2},
        {"id": 9, "value": "0102"},
        {"id": 1, "value": 300},
        {"named": {"value": "", "length": 0}},
        {"oid": "2.18446744073709551535"},
        {"oid": "[2A" + "FF" * 10 + "7F]"},
        {"arcs": "[" + "FF" * 9 + "7F]"},
        {"text": ""},
        {"nulls": []},
    ],
)
def test_variants_come_back_as_they_were(walker: Walker, change: dict[str, Any]) -> None:
    expected = EVERY | change
    if any(name.startswith("[") and name != "[]" for name in change) and "[]" not in change:
        expected["[]"] = max(int(name[1:-1]) for name in change) + 1  # the shortest bitmap that has them
    written = walker.json("Every", every(**change))
    assert isinstance(written, str), written
    assert json.loads(written) == expected


def test_members_stand_in_any_order_even_a_selector_behind_its_open_type(walker: Walker) -> None:
    backwards = dict(reversed(EVERY.items()))
    assert walker.json("Every", json.dumps(backwards)) == walker.json("Every", every())
    assert walker.json("Selected", '{"value":{"b":true,"a":2},"id":2}') == '{"id":2,"value":{"a":2,"b":true}}'


def test_a_default_stands_for_what_is_missing(walker: Walker) -> None:
    without = {name: value for name, value in EVERY.items() if name != "limit"}
    assert walker.ask("equal", "Every", f"{json.dumps(without)}|{every(limit=3)}") == "equal\n"
    assert walker.ask("equal", "Every", f"{json.dumps(without)}|{every(limit=4)}") == "different\n"


@pytest.mark.parametrize(
    ("text", "number"),
    [("3e2", 300), ("3.0e2", 300), ("300.000", 300), ("3000e-1", 300), ("-0", 0), ("0e99999999999", 0), ("-1E+1", -10)],
)
def test_a_whole_number_has_many_forms(walker: Walker, text: str, number: int) -> None:
    assert walker.json("small", text) == str(number)


def test_an_exponent_may_be_as_long_as_the_digits(walker: Walker) -> None:
    zeros = 20000
    assert walker.json("small", f"0.{'0' * zeros}7e{zeros + 1}") == "7"
    assert walker.json("small", f"7{'0' * zeros}e-{zeros}") == "7"
    assert refused(walker.json("small", f"7{'0' * zeros}e-9{zeros}")).status == "syntax error"
    assert refused(walker.json("small", f"7{'0' * zeros}e99999999999999999999999")).status == "out of range"


def test_escapes_and_surrogates_are_characters(walker: Walker) -> None:
    assert walker.json("text", r'"\u00e4\ud83d\ude00\n"') == '"\u00e4\U0001f600\\n"'
    assert walker.json("text", r'"\u0000"') == r'"\u0000"'
    assert walker.json("colour", r'"gre\u0065n"') == '"green"'


def test_octets_in_place_of_a_known_open_type_are_kept(walker: Walker) -> None:
    assert walker.json("Selected", '{"id":2,"value":"60"}') == '{"id":2,"value":"60"}'


PEER = """M DEFINITIONS AUTOMATIC TAGS ::= BEGIN
Flag ::= BOOLEAN  Nothing ::= NULL  Small ::= INTEGER (-10..300)  Colour ::= ENUMERATED {red, green}  Mask ::= BIT STRING (SIZE(7))
Big ::= BIT STRING (SIZE(70))  Named ::= BIT STRING (SIZE(0..20))  Key ::= OCTET STRING (SIZE(3))  Data ::= OCTET STRING
Name ::= IA5String  Text ::= UTF8String  Oid ::= OBJECT IDENTIFIER  Nulls ::= SEQUENCE OF NULL
Which ::= CHOICE {number INTEGER, inner Inner}  Inner ::= SEQUENCE {a INTEGER, b BOOLEAN OPTIONAL} END"""


@pytest.mark.parametrize(
    ("type_name", "value"),
    [
        ("flag", False),
        ("nothing", None),
        ("small", -3),
        ("colour", "green"),
        ("mask", (b"\xa2", 7)),
        ("big", (b"\x01" * 8 + b"\xfc", 70)),
        ("named", (b"\x80\x40", 10)),
        ("key", b"\xc0\xff\xee"),
        ("data", b"\x01"),
        ("name", 'a"\x01'),
        ("text", "\u00e4\u20ac"),
        ("oid", "1.2.840"),
        ("nulls", [None, None]),
        ("which", ("inner", {"a": 3})),
        ("Inner", {"a": 0, "b": True}),
    ],
)
def test_the_shapes_are_those_of_another_codec_of_jer(walker: Walker, type_name: str, value: object) -> None:
    text = peer().encode(type_name.capitalize(), value).decode()
    written = walker.json(type_name, text)
    assert isinstance(written, str), written
    assert json.loads(written) == json.loads(text)
    assert " " not in written


@functools.cache
def peer() -> Any:
    return asn1tools.compile_string(PEER, "jer")


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("type_name", "text", "status", "path", "sentence"),
    [
        ("small", "301", "out of range", "", "301 is not in -10..300"),
        ("positive", "4", "out of range", "", "4 is not in 5..MAX"),
        ("free", "9223372036854775808", "out of range", "", "9223372036854775808 does not fit into 64 bits"),
        ("free", "1e400", "out of range", "", "1e400 does not fit into 64 bits"),
        ("small", "3.5", "syntax error", "", "a whole number is expected at offset 0, found: 3.5"),
        ("small", "01", "syntax error", "", "a number is expected at offset 0, found: 01"),
        ("small", '"1"', "syntax error", "", 'a number is expected at offset 0, found: "1"'),
        ("small", "1 2", "syntax error", "", "the end of the text is expected at offset 2, found: 2"),
        ("flag", "null", "syntax error", "", "true or false is expected at offset 0, found: null"),
        ("colour", '"grean"', "no such alternative", "", "grean is no item of Colour; did you mean green?"),
        ("colour", '"[0]"', "no such alternative", "", "[0] is no item of Colour"),
        ("mask", '"A1"', "wrong size", "", "bits behind the end of the string are not zero"),
        ("mask", '"A"', "syntax error", "", 'hexadecimal text, two digits an octet, is expected at offset 0, found: "A"'),
        ("big", '"00"', "wrong size", "", "70 bits take 9 octets, 1 are there"),
        ("named", '{"value":"00"}', "missing or not allowed", "", "a bit string has the members value and length"),
        ("named", '{"value":"000000","length":21}', "wrong size", "", "21 bits are there, 0..20 bits are allowed"),
        ("key", '"00"', "wrong size", "", "1 octets are there, 3 octets are allowed"),
        ("name", '"\u00e4"', "character not allowed", "", "character 1, code 195, is not in the alphabet of Name"),
        ("name", '""', "wrong size", "", "0 characters are there, 1..8 characters are allowed"),
        ("digits", '"1A"', "character not allowed", "", 'character 2, "A", code 65, is not in the alphabet of Digits'),
        ("text", r'"\ud800"', "syntax error", "", r'an escape of JSON is expected at offset 1, found: \ud800"'),
        ("text", r'"\x"', "syntax error", "", r'an escape of JSON is expected at offset 1, found: \x"'),
        ("text", '"abc', "syntax error", "", "the end of a string is expected at offset 4, found: the end"),
        ("oid", '"1.40"', "syntax error", "", "numbers with points between them are expected, as 1.2.840"),
        ("oid", '"3.1"', "syntax error", "", "numbers with points between them are expected, as 1.2.840"),
        ("oid", '"[]"', "out of range", "", "the octets are no object identifier"),
        ("oid", '"[2A80]"', "out of range", "", "the octets are no object identifier"),
        ("oid", '"[2A8]"', "syntax error", "", "numbers with points between them are expected, as 1.2.840"),
        ("arcs", '"1..2"', "syntax error", "", "numbers with points between them are expected, as 1.2.840"),
        ("list", "[]", None, "", ""),
        ("which", "{}", "missing or not allowed", "", "one alternative is expected, none is there"),
        ("which", '{"number":1,"extra":true}', "syntax error", "", "one alternative is expected, several are there"),
        ("which", '{"numbre":1}', "syntax error", "", "numbre is no alternative of Which; did you mean number?"),
        ("which", '{"[0]":"00"}', "syntax error", "", "[0] is no alternative of Which"),
        ("which", '{"inner":{"a":4}}', "out of range", "inner.a", "4 is not in 0..3"),
        ("Inner", '{"b":true}', "missing or not allowed", "a", "is missing"),
        ("Inner", '{"a":1,"a":2}', "syntax error", "a", "the member a is there twice"),
        ("Inner", '{"a":1,"[0]":"00"}', "syntax error", "", "[0] is no component of Inner"),
        ("Inner", '{"a":1,}', "syntax error", "", "the name of a component is expected at offset 7, found: }"),
        ("Growing", '{"a":1,"[1]":"00"}', "out of range", "", "addition 1 is not in 2..16382: those below have names"),
        ("Growing", '{"a":1,"[5]":"00","[]":5}', "out of range", "", "a bitmap of 5 bits has no addition 5"),
        ("Growing", '{"a":1,"[5]":"00","[5]":"00"}', "syntax error", "", "the member [5] is there twice"),
        ("Growing", '{"a":1,"low":true}', "missing or not allowed", "high", "is missing: low is there, and both come together"),
        ("Selected", '{"value":{"a":9},"id":2}', "out of range", "value.a", "9 is not in 0..3"),
        ("Selected", '{"value":{"a":1}}', "missing or not allowed", "id", "is missing"),
    ],
)  # fmt: skip
def test_a_refusal_names_the_value_and_what_is_allowed(
    walker: Walker, type_name: str, text: str, status: str | None, path: str, sentence: str
) -> None:
    answer = walker.json(type_name, text)
    if status is None:  # an extensible size takes any number
        assert answer == text
    else:
        assert refused(answer) == Refusal(status, 0, path, sentence)


def test_a_path_goes_through_lists_and_choices(walker: Walker) -> None:
    inner = EVERY | {"list": [0, 99]}
    assert refused(walker.json("Every", every(next=inner))).path == "next.list[1]"


@pytest.mark.parametrize("text", ["[" * 300, '{"a":' * 300, "[" * 200 + "]" * 200])
def test_depth_is_bounded(walker: Walker, text: str) -> None:
    assert refused(walker.json("Deep", text)).status in ("nested too deeply", "syntax error")


@pytest.mark.parametrize(
    "octets", [b'"\xc0\x80"', b'"\xed\xa0\x80"', b'"\xf4\x90\x80\x80"', b'"\x80"', b'"\xe2\x82"', b'"\x01"']
)
def test_text_is_utf_8_without_raw_controls(walker: Walker, octets: bytes) -> None:
    assert refused(walker.json("text", octets)).status == "syntax error"


# ---------------------------------------------------------------- equality, checks, text


@pytest.mark.parametrize(
    ("type_name", "left", "right", "is_equal"),
    [
        ("named", {"value": "80", "length": 1}, {"value": "8000", "length": 12}, True),
        ("loose", {"value": "80", "length": 1}, {"value": "80", "length": 2}, False),
        ("which", {"[2]": "00"}, {"[2]": "01"}, False),
        ("Growing", {"a": 1, "b": True}, {"a": 1, "b": True, "[]": 2}, True),
        ("Growing", {"a": 1}, {"a": 1, "[]": 2}, False),
        ("Growing", {"a": 1, "[3]": "00"}, {"a": 1, "[3]": "00", "[]": 9}, False),
        ("Selected", {"id": 2, "value": "60"}, {"id": 2, "value": {"a": 3}}, False),
    ],
)
def test_equality_is_that_of_values(
    walker: Walker, type_name: str, left: object, right: object, is_equal: bool
) -> None:
    answer = walker.ask("equal", type_name, f"{json.dumps(left)}|{json.dumps(right)}")
    assert answer == ("equal\n" if is_equal else "different\n")


def test_a_gap_in_a_union_is_found_by_a_check_only(walker: Walker) -> None:
    assert walker.check("Every", every()).status == "ok"
    assert walker.check("Every", every(list=[17])) == Refusal(
        "breaks a constraint", 0, "list[0]", "17 is not allowed: 16..19 is left out"
    )


def test_the_size_of_utf_8_text_counts_characters_and_is_checked_only(walker: Walker) -> None:
    assert walker.check("Every", every(text="\u20ac\u20ac\u20ac")).status == "ok"
    assert walker.check("Every", every(text="abcd")).status == "wrong size"


def test_the_tree_shows_units_names_and_what_is_kept(walker: Walker) -> None:
    tree = walker.ask(
        "print", "Every", every(small=300, which={"number": 5}, value={"a": 1, "b": True}, **{"[4]": "00FF", "[]": 9})
    )
    lines = tree.splitlines()
    assert lines[0] == "Every:"
    for line in (
        "  small: 300 (none)",
        "  colour: green (5)",
        "  mask: '1010001'B (a, c)",
        "  named: '1000000001'B (x, y)",
        "  big: '0123456789ABCDEF04'H",
        '  text: "\u00e4\u20ac\U0001f600"',
        "  oid: 1.2.840.113549",
        "  maybe: 7 dB",
        "    [1]: 15",
        "  which: number: 5 m",
        "  value:",
        "    b: true",
        "  [4]: '00FF'H (unknown, kept)",
        "  []: 9 (additions that the sender counts, kept)",
    ):
        assert line in lines
    assert not any("first" in line for line in lines)


def test_elements_without_bits_are_read_up_to_the_number_that_is_decoded(walker: Walker) -> None:
    found = walker.json("nulls", json.dumps([None] * 65537))
    assert isinstance(found, Refusal)
    assert found[:3] == ("wrong size", 0, "")
    assert tells(found.text, "without bits", "65536")


@pytest.mark.parametrize(
    ("number", "unit", "shown"),
    [
        (500401189, "1e-7 degree", "500401189 (50.0401189 degree)"),
        (-7, "1e-7 degree", "-7 (-0.0000007 degree)"),
        (2028, "0.01 m/s", "2028 (20.28 m/s)"),
        (2000, "0.01 m/s", "2000 (20.00 m/s)"),
        (0, "0.1 m", "0 (0.0 m)"),
        (7, "0.0125 degree", "7 (0.0875 degree)"),
        (3, "1.5 degree", "3 (4.5 degree)"),
        (12, "1e-4 1/m", "12 (0.0012 1/m)"),
        (7, "256 ms", "7 (1792 ms)"),
        (50, "2 %", "50 (100 %)"),
        (5, "0.01", "5 (0.05)"),
        (37862, "ms", "37862 ms"),
        (5, "degree Celsius", "5 degree Celsius"),
        (5, "10^exponent Hz", "5 10^exponent Hz"),
        (5, "360/65535 degree", "5 360/65535 degree"),
        (2**63 - 1, "0.1 m", "9223372036854775807 (922337203685477580.7 m)"),
        (-(2**63), "1e-9 s", "-9223372036854775808 (-9223372036.854775808 s)"),
        (2**63 - 1, "256 ms", "9223372036854775807 256 ms"),
        (5, "0.1234567890123456789012 m", "5 0.1234567890123456789012 m"),
        (5, "", "5 "),
    ],
)
def test_a_number_is_shown_in_its_unit_exactly(walker: Walker, number: int, unit: str, shown: str) -> None:
    assert walker.ask("unit", "Every", f"{number}|{unit}") == f"Number: {shown}\n"


def test_a_value_to_start_from_has_defaults_and_nothing_optional(walker: Walker) -> None:
    lines = walker.ask("init", "Every", ".").splitlines()
    assert "  limit: 3" in lines
    assert "  list: empty" in lines
    assert not any(line.startswith(("  maybe", "  next", "  high", "  step")) for line in lines)


def test_texts_with_errors_at_random_do_no_harm_in_both_dialects(walker: Walker) -> None:
    # Each accepted text is written, read again and compared; a sanitizer ends the program at a fault.
    assert walker.ask("fuzz", "Every", f"3000 {every()}") == "done\n"
