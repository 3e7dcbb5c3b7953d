"""Values as CDR (XCDR1, little endian) and back: octets worked out by hand from the rules of the profile and of CDR."""

import re

import pytest

from tests.asn1.cdr_compiled import Compiled, RefusedError, compiled
from tests.asn1.compiled import schema_of

SCHEMA = schema_of(
    """
    All ::= SEQUENCE {small Small, wide Wide, flag Flag, long Long, name Name, octets Octets, bits Bits, lights Lights}
    Small ::= INTEGER (0..255)
    Wide ::= INTEGER (-5..70000)
    Flag ::= BOOLEAN
    Long ::= INTEGER (0..5000000000)
    Name ::= UTF8String
    Octets ::= OCTET STRING (SIZE(0..4))
    Bits ::= BIT STRING (SIZE(5))
    Lights ::= BIT STRING (SIZE(3..12))

    Points ::= SEQUENCE {before Small, points SEQUENCE (SIZE(0..3)) OF Point OPTIONAL, behind Small}
    Point ::= SEQUENCE {x Wide, y Small OPTIONAL}

    Either ::= SEQUENCE {kind Kind, what What, behind Small}
    Kind ::= ENUMERATED {red, green, blue, ...}
    What ::= CHOICE {one Small, many Points, none NULL, ...}

    Later ::= SEQUENCE {first Small, ..., [[second Small, third Wide OPTIONAL]]}
    Always ::= SEQUENCE {first Small DEFAULT 7, second Small}
    Beyond ::= SEQUENCE {number INTEGER (0..100, ...)}
    Where ::= SEQUENCE {place Place, behind Small}
    Place ::= CHOICE {near Small, regional RegionalExtension}
    RegionalExtension ::= SEQUENCE {regionId Small}
    """,
    "All", "Points", "Either", "Later", "Always", "Beyond", "Where",
)  # fmt: skip
HEAD = "00010000"
ALL = {
    "small": 7, "wide": 70000, "flag": True, "long": 4294967296, "name": "né", "octets": "C0FFEE", "bits": "A8",
    "lights": {"value": "FFA0", "length": 12},
}  # fmt: skip
ALL_CDR = (
    HEAD + "07 000000 70110100 01 00000000000000 0000000001000000 04000000 6ec3a900 03000000 c0ffee 00"
    "01000000 a8 03 0000 02000000 ffa0 04"
)


@pytest.fixture(scope="module")
def library() -> Compiled:
    return compiled(SCHEMA)


def octets(text: str) -> bytes:
    return bytes.fromhex(text.replace(" ", ""))


def refused(library: Compiled, name: str, text: str) -> RefusedError:
    with pytest.raises(RefusedError) as caught:
        library.from_cdr(name, octets(text))
    return caught.value


def test_numbers_lie_at_multiples_of_their_size_and_strings_end_in_a_zero(library):
    assert library.to_cdr("All", ALL) == (octets(ALL_CDR), [])
    assert library.from_cdr("All", octets(ALL_CDR)) == ALL


def test_what_is_absent_is_zero_and_its_flag_stands_behind_it(library):
    assert library.to_cdr("Points", {"before": 1, "behind": 2})[0] == octets(HEAD + "01 000000 00000000 00 02")
    value = {"before": 1, "points": [{"x": -5}, {"x": 3, "y": 9}], "behind": 2}
    text = HEAD + "01 000000 02000000 fbffffff 00 00 0000 03000000 09 01 01 02"
    assert library.to_cdr("Points", value)[0] == octets(text)
    assert library.from_cdr("Points", octets(text)) == value


def test_what_is_absent_is_not_looked_at(library):
    # Both points are out of range, and the flag behind the list says that there is no list.
    text = HEAD + "01 000000 02000000 ffffff7f 00 05 0000 ffffff7f 09 01 00 02"
    with pytest.raises(RefusedError):
        library.from_cdr("Points", octets(text.replace("01 00 02", "01 01 02")))
    assert library.from_cdr("Points", octets(text)) == {"before": 1, "behind": 2}


def test_padding_may_hold_anything(library):
    assert library.from_cdr("Points", octets(HEAD + "01 abcdef 00000000 00 02")) == {"before": 1, "behind": 2}


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ({"kind": "blue", "what": {"one": 5}, "behind": 6}, "02 00 05 00 00000000 00 00 06"),
        ({"kind": "red", "what": {"none": None}, "behind": 6}, "00 02 00 00 00000000 00 00 06"),
        ({"kind": "red", "what": {"many": {"before": 8, "points": [{"x": 1}], "behind": 9}}, "behind": 6},
         "00 01 00 08 01000000 01000000 00 00 01 09 06"),
    ],
)  # fmt: skip
def test_a_choice_is_a_number_and_every_alternative(library, value, text):
    assert library.to_cdr("Either", value) == (octets(HEAD + text), [])
    assert library.from_cdr("Either", octets(HEAD + text)) == value


def test_an_alternative_or_item_that_no_edition_knows_is_said(library):
    value = {"kind": "[0]", "what": {"[1]": "C0FFEE"}, "behind": 6}
    made, left = library.to_cdr("Either", value)
    assert made == octets(HEAD + "ff ff 00 00 00000000 00 00 06")
    assert left == ["kind", "what"]
    assert refused(library, "Either", made.hex()).path == "kind.value"


def test_an_addition_without_a_flag_is_there_if_anything_but_zero_is_in_it(library):
    for value in ({"first": 1}, {"first": 1, "second": 2}, {"first": 1, "second": 0, "third": 0}):
        made, left = library.to_cdr("Later", value)
        assert left == []
        assert library.from_cdr("Later", made) == value
    made, left = library.to_cdr("Later", {"first": 1, "second": 0})
    assert left == ["second"]
    assert library.from_cdr("Later", made) == {"first": 1}


def test_an_unknown_addition_is_said(library):
    made, left = library.to_cdr("Later", {"first": 1, "[2]": "C0FFEE"})
    assert made == library.to_cdr("Later", {"first": 1})[0]
    assert left == ["[2]"]


def test_a_default_is_written_out(library):
    made, _ = library.to_cdr("Always", {"second": 1})
    assert made == octets(HEAD + "07 01")
    assert library.from_cdr("Always", octets(HEAD + "09 01")) == {"first": 9, "second": 1}


def test_a_number_beyond_the_field_becomes_the_nearest_and_is_said(library):
    assert library.to_cdr("Beyond", {"number": 200}) == (octets(HEAD + "c8"), [])
    assert library.to_cdr("Beyond", {"number": 300}) == (octets(HEAD + "ff"), ["number"])


def test_a_string_with_a_zero_in_it_is_said_as_readers_of_ros_end_it_there(library):
    made, left = library.to_cdr("All", {**ALL, "name": "n\0é"})
    assert made == octets(ALL_CDR.replace("04000000 6ec3a900 03000000", "05000000 6e00c3a9 00 000000 03000000"))
    assert left == ["name"]
    assert library.from_cdr("All", made) == {**ALL, "name": "n\0é"}


@pytest.mark.parametrize(
    ("name", "text", "path", "octet", "words"),
    [
        ("All", ALL_CDR.replace("70110100", "71110100"), "wide.value", 8, "70001 is not in -5..70000"),
        ("All", ALL_CDR.replace("01 00000000000000", "02 00000000000000"), "flag.value", 12, "2 is no bool: 0 or 1"),
        ("All", ALL_CDR.replace("6ec3a900", "6ec3a901"), "name.value", 35, "ends in a zero"),
        ("All", ALL_CDR.replace("6ec3a900", "6ec36900"), "name.value", 28, "not UTF-8"),
        ("All", ALL_CDR.replace("a8 03", "a8 02"), "bits.bits_unused", 49, "2 bits unused, of this string it is always 3"),
        ("All", ALL_CDR.replace("ffa0 04", "ffa0 00"), "lights.bits_unused", 58, "16 bits are there, 3..12 bits are allowed"),
        ("All", ALL_CDR.replace("ffa0 04", "ffa0 09"), "lights.bits_unused", 58, "9 bits unused"),
        ("Points", HEAD + "01 000000 04000000" + "00000000 00 00 0000" * 3 + "00000000 00 00 01 02", "points", 8,
         "4 elements are there, 0..3 elements are allowed"),
        ("Points", HEAD + "01 000000 ffffff7f 00000000 00 00 01 02", "points", 8, "2147483647 elements"),
        ("Points", HEAD + "01 000000 01000000 00001100 00 00 01 02", "points[0].x.value", 12,
         "1114112 is not in -5..70000"),
        ("Either", HEAD + "03 00 05 00 00000000 00 00 06", "kind.value", 4, "3 is no item of Kind"),
        ("Either", HEAD + "00 03 05 00 00000000 00 00 06", "what.choice", 5, "3 is no alternative"),
        ("Always", "00000000 07 01", "", 0, "big endian"),
        ("Always", "00070000 07 01", "", 0, "XCDR2"),
        ("Always", "c0ffee00 07 01", "", 0, "no encapsulation"),
        ("Always", "0001", "", 2, "truncated"),
        ("Always", HEAD + "07 01 0000000000", "", 6, "octets behind the end"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_field_octet_value_and_range(library, name, text, path, octet, words):
    error = refused(library, name, text)
    assert (error.path, error.octet) == (path, octet)
    assert words in error.text


def test_an_end_at_any_octet_is_refused_there(library):
    whole = octets(ALL_CDR)
    for end in range(len(whole)):
        error = refused(library, "All", whole[:end].hex())
        assert "truncated" in error.text
        assert error.octet <= end
        assert bool(error.path) == (end >= 4)


def test_up_to_three_octets_may_fill_the_end(library):
    assert library.from_cdr("Always", octets(HEAD + "07 01 000000")) == {"second": 1, "first": 7}


def test_what_was_read_is_written_as_it_was(library):
    # Its strings lie in the octets that were read: written over those, a string of three octets lost its first.
    assert library.again("All", octets(ALL_CDR)) == octets(ALL_CDR)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Either", {"kind": "[0]", "what": {"[1]": "C0FFEE"}, "behind": 6}),
        ("Where", {"place": {"regional": {"regionId": 4}}, "behind": 6}),
        ("Beyond", {"number": 300}),
    ],
)
def test_what_something_was_left_out_of_is_written_as_it_was(library, name, value):
    made, left = library.to_cdr(name, value)
    assert left
    assert library.again(name, made, takes_unknown=True) == made


def test_what_has_no_number_is_refused_where_a_message_is_wanted(library):
    made, left = library.to_cdr("Where", {"place": {"regional": {"regionId": 4}}, "behind": 6})
    assert (made, left) == (octets(HEAD + "ff 00 06"), ["place"])
    assert refused(library, "Where", made.hex()).text == "255 is no alternative"
    with pytest.raises(ValueError, match="status"):  # neither known nor what stands for something left out
        library.again("Where", octets(HEAD + "01 00 06"), takes_unknown=True)


def test_a_buffer_too_small_is_refused_with_what_it_takes(library):
    with pytest.raises(ValueError, match=re.escape(f"{len(octets(ALL_CDR))} octets")):
        library.to_cdr("All", ALL, room=len(octets(ALL_CDR)) - 1)
    assert library.to_cdr("All", ALL, room=len(octets(ALL_CDR)))[0] == octets(ALL_CDR)
