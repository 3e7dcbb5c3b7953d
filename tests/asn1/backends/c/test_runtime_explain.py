"""The decoder from the tables alone: every step with its clause, every refusal with its bit (X.691 02/2021)."""

from collections.abc import Iterator
from itertools import pairwise

import pytest

from tests.asn1.walker import Refusal, Step, Walker, build
from tests.said import tells


@pytest.fixture(scope="module")
def walker() -> Iterator[Walker]:
    walker = Walker(build())
    yield walker
    walker.close()


def bits(text: str) -> str:
    """Hexadecimal of bits, filled up with zeros."""
    text = text.replace(" ", "")
    text += "0" * (-len(text) % 8)
    return bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8)).hex()


def test_a_sequence_is_told_bit_by_bit(walker: Walker) -> None:
    # extension bit, a, bitmap of 4 (b, the group, one unknown), each an open type
    octets = bits("1 10 0000011 1101 00000001 1000 0000 00000010 1 0000 0101 1 00 0000 00000010 1100000011111111")
    steps, end = walker.explain("Growing", octets)
    assert end.status == "ok"
    assert [step for step in steps if step.what not in ("enter", "leave")] == [
        Step("extension", 0, 1, "", "1", "19.1"),
        Step("value", 1, 2, "a", "2", "13.2.2"),
        Step("length", 3, 7, "", "4", "19.8"),
        Step("presence", 10, 4, "", "1101", "19.7"),
        Step("open", 14, 8, "", "1", "11.2"),
        Step("value", 22, 1, "b", "true", "12.2"),
        Step("padding", 23, 7, "", "", "11.2.1"),
        Step("open", 30, 8, "", "2", "11.2"),
        Step("presence", 38, 1, "", "1", "19.9"),
        Step("value", 39, 8, "high", "5", "13.2.2"),
        Step("value", 47, 1, "low", "true", "12.2"),
        Step("padding", 48, 6, "", "", "11.2.1"),
        Step("open", 54, 8, "[3]", "2", "11.2"),
        Step("unknown", 62, 16, "[3]", "C0FF", "19.9"),
        Step("padding", 78, 2, "", "", "11.1.3"),
    ]


@pytest.mark.parametrize(
    ("type_name", "encoding", "shown"),
    [
        ("flag", "1", ["12.2 true"]),
        ("nothing", "", ["18 null"]),
        ("small", "100110110", ["13.2.2 300 (none)"]),
        ("wide", "0 1010", ["13.1 0", "13.2.2 10"]),
        ("wide", "1 00000010 1111111100000000", ["13.1 1", "11.9.3.6 2", "13.1 -256"]),
        ("free", "00001000 1" + "0" * 63, ["11.9.3.6 8", f"13.2.4 {-2**63}"]),
        ("positive", "00000001 11111111", ["11.9.3.6 1", "13.2.3 260"]),
        ("colour", "0 1", ["14.3 0", "14.2 green (5)"]),
        ("colour", "1 0000000", ["14.3 1", "14.3 blue (2)"]),
        ("colour", "1 0000001", ["14.3 1", "14.3 [1] (unknown)"]),
        ("colour", "1 1 00000001 01000000", ["14.3 1", "14.3 [64] (unknown)"]),
        ("mask", "1000001", ["16.9 '1000001'B (a, c)"]),
        ("named", "00010 10", ["11.9.4.1 2", "16.11 '10'B (x)"]),
        ("named", "00000", ["11.9.4.1 0", "16.8 ''B"]),
        ("big", "1" * 70, ["16.10 'FFFFFFFFFFFFFFFFFC'H"]),
        ("loose", "1 00000101 10101", ["16.6 1", "11.9.3.6 5", "16.11 '10101'B"]),
        ("key", "0000000111111111 00000010", ["17.7 '01FF02'H"]),
        ("data", "0 00 00001111", ["17.3 0", "11.9.4.1 1", "17.8 '0F'H"]),
        ("name", "001 1000001 0100010", ["11.9.4.1 2", '30.5.7 "A\\""']),
        ("digits", "0000 1010", ['30.5.6 " 9"']),
        ("code", "0 010 0000 1111", ["30.4 0", "11.9.4.1 2", '30.5.7 "0F"']),
        ("code", "1 00000101" + "1111010" * 5, ["30.4 1", "11.9.3.6 5", '30.5.7 "zzzzz"']),
        ("label", "00000001 0100111", ["11.9.3.6 1", "30.5.7 \"'\""]),
        ("text", "00000010 1100001110100100", ["11.9.3.6 2", '30.6 "\u00e4"']),
        ("oid", "00000011 00101010 10000110 01001000", ["11.9.3.6 3", "24 1.2.840"]),
        ("arcs", "00000010 11000010 01111011", ["11.9.3.6 2", "25 8571"]),
        ("list", "0 01 00000 11111", ["20.4 0", "11.9.4.1 2", "13.2.2 0", "13.2.2 31"]),
        ("nulls", "00000010", ["11.9.3.6 2", "18 null"]),
        ("which", "0 0 00000111", ["23.5 0", "23.7 number", "13.2.2 7 m"]),
        ("which", "1 0000000 00000001 10000000", ["23.5 1", "23.8 extra", "11.2 1", "12.2 true", "11.2.1 "]),
        ("which", "1 0000011 00000001 10000000", ["23.5 1", "23.8 [3]", "11.2 1", "23.8 80"]),
        ("Selected", "0010 00000001 0 10 00000", ["13.2.2 2", "11.2 1", "19.2 0", "13.2.2 2", "11.2.1 "]),
        ("Selected", "0111 00000001 11111111", ["13.2.2 7", "11.2 1", "11.2 FF"]),
    ],
)  # fmt: skip
def test_every_kind_has_its_clause(walker: Walker, type_name: str, encoding: str, shown: list[str]) -> None:
    steps, end = walker.explain(type_name, bits(encoding) or "00")
    assert end.status == "ok", end
    told = [
        f"{step.clause} {step.text}"
        for step in steps
        if step.what not in ("enter", "leave") and step.clause != "11.1.3"
    ]
    assert told == shown
    inside = [step for step in steps if step.width > 0]
    assert inside[0].bit == 0
    assert all(step.bit + step.width == after.bit for step, after in pairwise(inside))


@pytest.mark.parametrize(
    ("type_name", "encoding", "expected"),
    [
        ("small", "111111111", Refusal("out of range", 0, "", "501 is not in -10..300")),
        ("small", "1", Refusal("truncated", 0, "", "9 bits are needed, the message has 8 more")),
        ("free", "00000000", Refusal("malformed length", 0, "", "a number has 1 to 8 octets")),
        ("free", "00001001" + "0" * 72, Refusal("out of range", 0, "", "the number has more than 64 bits")),
        ("colour", "1 1 00000100 01000000 000000000000000000000000", Refusal("out of range", 1, "", "index 1073741824 is larger than any that is kept")),
        ("named", "10101", Refusal("wrong size", 0, "", "21 bits are announced, 0..20 bits are allowed")),
        ("digits", "0000 1111", Refusal("character not allowed", 4, "", "character 2, bits of value 15, is not in the alphabet of Digits")),
        ("text", "00000001 10000000", Refusal("character not allowed", 8, "", "the octets are not UTF-8")),
        ("oid", "00000001 10000001", Refusal("out of range", 0, "", "the octets are no object identifier")),
        ("Blob", "11000000", Refusal("malformed length", 0, "", "a fragment has 1 to 4 times 16384 items")),
        ("Blob", "11000101", Refusal("malformed length", 0, "", "a fragment has 1 to 4 times 16384 items")),
        ("Blob", "10111111 11111111", Refusal("truncated", 16, "", "131064 bits are needed, the message has 0 more")),
        ("which", "1 0000000 00000010 1000000000000000", Refusal("malformed length", 17, "extra", "the open type is longer than its value by 1 octets")),
        ("which", "1 0000000 00000001 11000000", Refusal("malformed length", 17, "extra", "the padding of the open type is not zero")),
        ("which", "1 0000000 00000000", Refusal("malformed length", 8, "extra", "an open type has at least one octet")),
        ("Selected", "0001 00000001 00000000", Refusal("truncated", 12, "value", "9 bits are needed, the open type has 8 more")),
        ("Growing", "1 00 1 00000000", Refusal("malformed length", 3, "", "the bitmap of the additions has no length that can be")),
        ("flag", "11", Refusal("octets behind the end", 1, "", "the padding of the last octet is not zero")),
        ("flag", "10000000 00000000", Refusal("octets behind the end", 8, "", "1 octets follow the end of the message")),
        ("list", "0 11 11111 11111 11111", Refusal("wrong size", 1, "", "4 elements are announced, 1..3 elements are allowed")),
    ],
)  # fmt: skip
def test_a_refusal_names_path_bit_and_sentence(
    walker: Walker, type_name: str, encoding: str, expected: Refusal
) -> None:
    assert walker.explain(type_name, bits(encoding))[1] == expected


def test_fragments_are_one_string(walker: Walker) -> None:
    steps, end = walker.explain("Blob", "c1" + "ab" * 16384 + "02" + "cdef")
    assert end.status == "ok"
    assert [(step.what, step.bit, step.width, step.clause) for step in steps] == [
        ("length", 0, 8, "11.9.3.8"),
        ("value", 8, 131072, "17.8"),
        ("length", 131080, 8, "11.9.3.6"),
        ("value", 131088, 16, "17.8"),
    ]


def test_the_value_of_an_open_type_goes_on_behind_the_header_of_a_fragment(walker: Walker) -> None:
    # The open type of alternative blob: 16386 octets in two fragments; the string in it is one fragment and an empty one.
    content = "c1" + "ab" * 16384 + "00"
    steps, end = walker.explain("which", bits("1 0000001") + "c1" + content[: 2 * 16384] + "02" + content[2 * 16384 :])
    assert end == Refusal("ok", 8 * 16389, "", "")
    assert [(step.what, step.bit, step.width, step.clause) for step in steps[3:-1]] == [
        ("open", 8, 8, "11.9.3.8"),
        ("length", 16, 8, "11.9.3.8"),
        ("value", 24, 131072 + 8, "17.8"),
        ("open", 131088, 8, "11.9.3.6"),
        ("length", 131104, 8, "11.9.3.6"),
        ("value", 131112, 0, "17.5"),
    ]


def test_an_open_type_may_have_many_fragments(walker: Walker) -> None:
    content = "c4" + "ab" * 65536 + "c1" + "cd" * 16384 + "00"
    cuts = (0, 65536, 65536 + 16384, len(content) // 2)
    parts = [content[2 * start : 2 * end] for start, end in pairwise(cuts)]
    octets = bits("1 0000001") + "c4" + parts[0] + "c1" + parts[1] + f"{len(parts[2]) // 2:02x}" + parts[2]
    steps, end = walker.explain("which", octets)
    assert end == Refusal("ok", len(octets) * 4, "", "")
    assert [step.text for step in steps if step.what == "open"] == ["65536", "16384", "3"]
    assert [step.bit for step in steps] == sorted(step.bit for step in steps)


def test_fragments_of_an_open_type_are_checked_before_its_value(walker: Walker) -> None:
    assert walker.explain("which", bits("1 0000000") + "c1" + "80" + "00" * 16383)[1].status == "truncated"
    assert (
        walker.explain("which", bits("1 0000000") + "c1" + "80" + "00" * 16383 + "c0")[1].status == "malformed length"
    )
    end = walker.explain("which", bits("1 0000000") + "c1" + "80" + "00" * 16383 + "00")[1]
    assert end[:3] == ("malformed length", 17, "extra")
    assert tells(end.text, "open type", "longer", "16383 octets")


def test_elements_without_bits_are_refused_beyond_a_number(walker: Walker) -> None:
    refusal = walker.explain("nulls", "c4" * 1000)[1]
    assert refusal.status == "wrong size"
    assert tells(refusal.text, "nothing bounds", "elements")


def test_depth_is_bounded(walker: Walker) -> None:
    assert walker.explain("Deep", "01" * 63 + "00")[1].status == "ok"
    assert walker.explain("Deep", "01" * 64 + "00")[1] == Refusal(
        "nested too deeply", 512, "[0]" * 64, "nested too deeply"
    )


@pytest.mark.parametrize("type_name", ["Every", "Growing", "which", "Deep", "Selected", "code"])
def test_octets_at_random_do_no_harm(type_name: str) -> None:
    # Each value that is read is written, read again and compared; a sanitizer ends the program at a fault.
    seeds = {
        "Every": '{"flag":true}', "Growing": '{"a":1,"b":true,"[3]":"AABB","[]":12}', "which": '{"inner":{"a":3,"b":true}}',
        "Deep": "[[],[[],[]]]", "Selected": '{"value":{"b":true,"a":2},"id":2}', "code": '"A\\u0030"',
    }  # fmt: skip
    walker = Walker(build())
    assert walker.ask("fuzz", type_name, f"10000 {seeds[type_name]}") == "done\n"
    walker.close()
