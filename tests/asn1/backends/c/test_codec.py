"""Generated C codec, compared with bits counted by hand from X.691."""

import json
from pathlib import Path
from random import Random
from typing import Any

import pytest

from asn1.backends.c import library
from asn1.layout.layout import lay_out
from asn1.layout.memory import arena_octets
from asn1.model.text import load_schema
from tests.asn1.compiled import ROOT, Compiled, RefusedError, compiled, octets_of, schema_of

MODULE = """
Narrow ::= INTEGER (-5..10)
Wide ::= INTEGER (0..4294967295)
Widest ::= INTEGER (-9223372036854775808..9223372036854775807)
Single ::= INTEGER (7)
Semi ::= INTEGER (5..MAX)
Least ::= INTEGER (MIN..5)
Free ::= INTEGER
Growing ::= INTEGER (1..32, ...)
Gap ::= INTEGER (0..3 | 6..7)
Colour ::= ENUMERATED { red, green, blue }
Sparse ::= ENUMERATED { low(-3), high(70000), ..., late(5), later(9) }
Flags ::= BIT STRING { first(0), third(2) } (SIZE(1..12))
Wanted ::= BIT STRING { first(0), third(2) } (SIZE(3..8))
Signs ::= BIT STRING { first(0), third(2) } (SIZE(8, ...))
Crowd ::= BIT STRING { first(0), third(2) } (SIZE(70000..MAX))
Mask ::= BIT STRING (SIZE(4))
Long ::= BIT STRING (SIZE(70))
Bits ::= BIT STRING (SIZE(2..5, ...))
AnyBits ::= BIT STRING
Octets ::= OCTET STRING (SIZE(1..4))
Fixed ::= OCTET STRING (SIZE(3))
AnyOctets ::= OCTET STRING
Plate ::= IA5String (FROM("A".."D")) (SIZE(0..7))
Number ::= NumericString (SIZE(1..16))
Name ::= IA5String (SIZE(1..4, ...))
Text ::= UTF8String (SIZE(1..3))
Path ::= OBJECT IDENTIFIER
Numbers ::= SEQUENCE (SIZE(0..3)) OF INTEGER (0..3)
Pairs ::= SEQUENCE (SIZE(2, ...)) OF Pair
Endless ::= SEQUENCE (SIZE(1..MAX, ...)) OF BOOLEAN
Broad ::= SEQUENCE (SIZE(1..1000, ...)) OF BOOLEAN
Huge ::= SEQUENCE (SIZE(0..70000)) OF BOOLEAN
Before ::= SEQUENCE { seven INTEGER (0..127), broad Broad }
Nothings ::= SEQUENCE OF NULL
Many ::= SEQUENCE OF BOOLEAN
Alike ::= IA5String (FROM("A"))
Voids ::= SEQUENCE (SIZE(0..3, ...)) OF NULL
Pair ::= SEQUENCE { a INTEGER (0..3), b BOOLEAN }
Record ::= SEQUENCE { a INTEGER (0..3) OPTIONAL, b Pair, c Colour DEFAULT green, d OCTET STRING (SIZE(1)) }
Signal ::= SEQUENCE { some BIT STRING { a(0), c(2) } (SIZE(8)) DEFAULT { a, c }, none BIT STRING { a(0) } (SIZE(4)) DEFAULT {} }
Empty ::= SEQUENCE {}
Old ::= SEQUENCE { a BOOLEAN, ... }
New ::= SEQUENCE { a BOOLEAN, ..., b INTEGER (0..255), [[ c BOOLEAN, d Pair OPTIONAL ]], e NULL }
Choose ::= CHOICE { x NULL, y Pair, ... }
Chosen ::= CHOICE { x NULL, y Pair, ..., z INTEGER (0..7), w OCTET STRING }
Deep ::= SEQUENCE { here INTEGER (0..1), more Deep OPTIONAL }
Nest ::= CHOICE { leaf INTEGER (0..1), more Nest }
Nests ::= SEQUENCE OF Nests
Branch ::= CHOICE { leaf NULL, ..., more Branch }
Branches ::= SEQUENCE OF Branch
Large ::= SEQUENCE { first OCTET STRING (SIZE(64)), second OCTET STRING (SIZE(64)), third INTEGER (0..255) }
Holder ::= SEQUENCE { large Large OPTIONAL, either CHOICE { large Large, no NULL } }
One ::= SEQUENCE (SIZE(1..4)) OF Choose
Inner ::= Record (WITH COMPONENTS { ..., a PRESENT, c (red | blue) })
Either ::= Old2 (WITH COMPONENTS { ..., p PRESENT, q ABSENT } | WITH COMPONENTS { ..., p ABSENT, q PRESENT })
Twice ::= SEQUENCE { one Pairs2, other Pairs2 (WITH COMPONENT (WITH COMPONENTS { ..., b (TRUE) })) }
Thrice ::= SEQUENCE { all Pairs2 (WITH COMPONENT (WITH COMPONENTS { ..., b (TRUE) })) }
Pairs2 ::= SEQUENCE OF Pair (WITH COMPONENTS { ..., a (0 | 2) })
Old2 ::= SEQUENCE { p NULL OPTIONAL, q NULL OPTIONAL }
Serial ::= Pairs (WITH COMPONENT (WITH COMPONENTS { ..., a (ALL EXCEPT 1) }))
HOLDS ::= CLASS { &id INTEGER (0..255) UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }
Held HOLDS ::= { { Pair IDENTIFIED BY 1 } | { INTEGER (0..3) IDENTIFIED BY 2 }, ... }
OpenLater ::= SEQUENCE { a BOOLEAN, ..., [[ id HOLDS.&id ({Held}), value HOLDS.&Type ({Held}{@id}) ]] }
Open ::= SEQUENCE { id HOLDS.&id ({Held}), value HOLDS.&Type ({Held}{@id}) }
"""
NAMES_OF_TYPES = tuple(
    line.split()[0] for line in MODULE.strip().splitlines() if line.split()[1] == "::=" and line.split()[0] != "HOLDS"
)


@pytest.fixture(scope="module")
def codec() -> Compiled:
    return compiled(schema_of(MODULE, *NAMES_OF_TYPES), NAMES_OF_TYPES)


# name, value as JSON, bits
GOOD: list[tuple[str, Any, str]] = [
    ("Narrow", -5, "0000"),  # 11.5.7.1: four bits for 16 values
    ("Narrow", 10, "1111"),
    ("Wide", 1, "0" * 31 + "1"),
    ("Widest", -(1 << 63), "0" * 64),
    ("Widest", (1 << 63) - 1, "1" * 64),
    ("Semi", 5, "00000001 00000000"),  # 11.7: length, then the distance from the lower bound
    ("Semi", 261, "00000010 00000001 00000000"),
    ("Least", -129, "00000010 11111111 01111111"),  # 11.8: a lower bound is missing
    ("Free", 127, "00000001 01111111"),
    ("Free", 128, "00000010 00000000 10000000"),
    ("Free", -(1 << 63), "00001000 10000000" + "0" * 56),
    ("Growing", 32, "0 11111"),  # 13.1
    ("Growing", 33, "1 00000001 00100001"),
    ("Gap", 6, "110"),
    ("Colour", "blue", "10"),
    ("Sparse", "high", "0 1"),  # 14.2
    ("Sparse", "late", "1 0000000"),  # 14.3: index of the addition as a normally small number
    ("Sparse", "[63]", "1 0111111"),
    ("Sparse", "[64]", "1 1 00000001 01000000"),  # 11.6.2
    ("Flags", {"value": "A000", "length": 12}, "0010 101"),  # 16.2: trailing zeros of named bits are left out
    ("Flags", {"value": "00", "length": 3}, "0000 0"),  # but for those that the size needs
    ("Wanted", {"value": "D0", "length": 4}, "001 1101"),
    ("Wanted", {"value": "80", "length": 1}, "000 100"),  # 16.3: zeros are added where the size needs them
    ("Signs", {"value": "80", "length": 1}, "0 10000000"),
    ("Signs", {"value": "", "length": 0}, "0 00000000"),
    ("Signs", {"value": "8080", "length": 9}, "1 00001001 100000001"),
    ("Mask", "A0", "1010"),
    ("Long", "00" * 8 + "04", "0" * 69 + "1"),
    ("Bits", {"value": "C0", "length": 3}, "0 01 110"),
    ("Bits", {"value": "FC", "length": 6}, "1 00000110 111111"),  # 16.6
    ("AnyBits", {"value": "80", "length": 1}, "00000001 1"),
    ("Octets", "FF00", "01 11111111 00000000"),
    ("Fixed", "010203", "00000001 00000010 00000011"),
    ("AnyOctets", "", "00000000"),
    ("Plate", "AD", "010 00 11"),  # 30.5.2, 30.5.4: two bits for four letters, their indexes
    ("Number", "0 9", "0010 0001 0000 1010"),
    ("Name", "a", "0 00 1100001"),
    ("Name", "abcde", "1 00000101" + "".join(f"{ord(c):07b}" for c in "abcde")),  # 30.4
    ("Text", "é", "00000010 11000011 10101001"),  # the size is not seen: octets are counted
    ("Path", "1.2.840", "00000011 00101010 10000110 01001000"),
    ("Numbers", [], "00"),
    ("Numbers", [1, 2, 3], "11 01 10 11"),
    ("Pairs", [{"a": 1, "b": True}, {"a": 2, "b": False}], "0 011 100"),  # 20.5: no length
    ("Pairs", [{"a": 1, "b": True}], "1 00000001 011"),
    ("Nothings", [None] * 5, "00000101"),
    ("Endless", [True], "0 00000001 1"),
    ("Endless", [], "1 00000000"),
    ("Broad", [True], "0 0000000000 1"),
    ("Before", {"seven": 0, "broad": []}, "0000000 1 00000000"),
    ("Huge", [True], "00000001 1"),  # 11.9.4.1: an upper bound of 64K and more is none
    ("Record", {"b": {"a": 3, "b": False}, "c": "green", "d": "FF"}, "00 110 11111111"),  # 19.5
    ("Record", {"a": 0, "b": {"a": 3, "b": False}, "c": "red", "d": "00"}, "11 00 110 00 00000000"),
    ("Signal", {"some": "A0", "none": "00"}, "00"),  # a DEFAULT has the size of its type
    ("Signal", {"some": "05", "none": "80"}, "11 00000101 1000"),
    ("Empty", {}, "00000000"),  # 11.1.3: an empty encoding is an octet; it is counted as one
    ("Old", {"a": True}, "0 1"),
    ("New", {"a": True}, "0 1"),
    ("New", {"a": True, "b": 255}, "1 1 0000010 100 00000001 11111111"),  # 19.7 to 19.9
    ("New", {"a": True, "c": True}, "1 1 0000010 010 00000001 01000000"),
    ("New", {"a": True, "c": False, "d": {"a": 1, "b": True}}, "1 1 0000010 010 00000001 10011000"),
    ("New", {"a": True, "e": None}, "1 1 0000010 001 00000001 00000000"),
    ("Choose", {"y": {"a": 0, "b": True}}, "0 1 001"),
    ("Chosen", {"z": 7}, "1 0000000 00000001 11100000"),  # 23.8
    ("Chosen", {"w": "AB"}, "1 0000001 00000010 00000001 10101011"),
    ("Holder", {"either": {"no": None}}, "0 1"),
    ("Open", {"id": 1, "value": {"a": 3, "b": True}}, "00000001 00000001 11100000"),
    ("Open", {"id": 2, "value": 3}, "00000010 00000001 11000000"),
    ("OpenLater", {"a": True, "id": 2, "value": 3}, "1 1 0000000 1 00000011 00000010 00000001 11000000"),
    ("Open", {"id": 3, "value": "ABCD"}, "00000011 00000010 10101011 11001101"),
]


@pytest.mark.parametrize(("name", "value", "bits"), GOOD)
def test_a_value_has_these_bits_and_they_have_this_value(codec: Compiled, name: str, value: Any, bits: str) -> None:
    assert codec.bits(name, value) == bits.replace(" ", "")
    assert codec.again(name, octets_of(bits)) == octets_of(bits)
    codec.validate(name, value)


BAD_VALUES: list[tuple[str, Any, str]] = [
    ("Narrow", 11, "out of range"),
    ("Narrow", -6, "out of range"),
    ("Single", 8, "out of range"),
    ("Semi", 4, "out of range"),
    ("Least", 6, "out of range"),
    ("Octets", "", "wrong size"),
    ("Numbers", [0, 0, 0, 0], "wrong size"),
    ("Plate", "E", "character not allowed"),
    ("Flags", {"value": "FFF8", "length": 13}, "wrong size"),
    ("New", {"a": True, "d": {"a": 1, "b": True}}, "missing or not allowed"),
]


@pytest.mark.parametrize(("name", "value", "why"), BAD_VALUES)
def test_what_cannot_be_encoded_is_refused(codec: Compiled, name: str, value: Any, why: str) -> None:
    with pytest.raises(RefusedError, match=why):
        codec.bits(name, value)
    with pytest.raises(RefusedError, match=why):
        codec.validate(name, value)


@pytest.mark.parametrize(
    ("name", "most"),
    [("Nothings", [None] * 65536), ("Voids", [None] * 65536), ("Alike", "A" * 65536)],
)
def test_what_takes_no_bits_is_encoded_as_far_as_it_is_decoded(codec: Compiled, name: str, most: Any) -> None:
    bits = codec.bits(name, most)
    assert codec.again(name, octets_of(bits)) == octets_of(bits)
    codec.validate(name, most)
    for refused in (codec.bits, codec.validate):
        with pytest.raises(RefusedError, match="wrong size"):
            refused(name, most + most[:1])
    with pytest.raises(RefusedError, match="wrong size"):
        codec.again(name, octets_of(("1" if name == "Voids" else "") + "11000100 00000001"))


@pytest.mark.parametrize("name", ["Nothings", "Voids"])
def test_a_list_in_memory_of_more_without_bits_is_refused(codec: Compiled, name: str) -> None:
    for count, why in ((65536, "ok"), (65537, "wrong size")):
        assert codec.of_memory(name, count) == (why, why)


INVALID: list[tuple[str, Any, str]] = [
    ("Gap", 4, "breaks a constraint"),
    ("Text", "abcd", "wrong size"),
    ("Inner", {"b": {"a": 0, "b": True}, "c": "red", "d": "00"}, "breaks a constraint"),
    ("Inner", {"a": 1, "b": {"a": 0, "b": True}, "c": "green", "d": "00"}, "breaks a constraint"),
    ("Either", {"p": None, "q": None}, "breaks a constraint"),
    ("Serial", [{"a": 0, "b": True}, {"a": 1, "b": True}], "breaks a constraint"),
    ("Twice", {"one": [{"a": 1, "b": True}], "other": []}, "breaks a constraint"),
    ("Twice", {"one": [], "other": [{"a": 2, "b": False}]}, "breaks a constraint"),
    ("Thrice", {"all": [{"a": 2, "b": False}]}, "breaks a constraint"),
]


@pytest.mark.parametrize(("name", "value", "why"), INVALID)
def test_what_the_encoding_does_not_see_is_seen_by_validate(codec: Compiled, name: str, value: Any, why: str) -> None:
    assert codec.bits(name, value)
    with pytest.raises(RefusedError, match=why):
        codec.validate(name, value)


def test_validate_takes_what_the_constraints_of_components_allow(codec: Compiled) -> None:
    codec.validate("Inner", {"a": 1, "b": {"a": 0, "b": True}, "c": "blue", "d": "00"})
    codec.validate("Either", {"q": None})
    codec.validate("Twice", {"one": [{"a": 2, "b": False}], "other": [{"a": 0, "b": True}]})
    codec.validate("Serial", [{"a": 0, "b": True}, {"a": 2, "b": True}])


def test_a_serial_constraint_takes_the_extension_marker(codec: Compiled) -> None:
    # X.680 50.11, X.691 10.3.20: `Pairs (WITH COMPONENT ...)` has no extension bit, `Pairs` has one
    value = [{"a": 2, "b": True}, {"a": 2, "b": True}]
    assert codec.bits("Pairs", value) == "0101101"
    assert codec.bits("Serial", value) == "101101"


BAD_OCTETS: list[tuple[str, str, str]] = [
    ("Wide", "0" * 24, "truncated"),
    ("Colour", "11", "no such alternative"),
    ("Narrow", "0000 0000 1", "octets behind the end"),
    ("Narrow", "0000 0001", "octets behind the end"),  # padding that is not zero
    ("Free", "00000000", "malformed length"),
    ("Free", "00001001" + "0" * 72, "out of range"),
    ("Free", "11000101", "malformed length"),  # five times 16K (11.9.3.8)
    ("AnyOctets", "11000001", "truncated"),
    ("Many", "10111111 11111111", "truncated"),
    ("Text", "00000001 11000000", "character not allowed"),
    ("Text", "00000011 11101101 10100000 10000000", "character not allowed"),  # a surrogate
    ("Number", "0000 1011", "character not allowed"),
    ("Path", "00000001 10000001", "out of range"),
    ("New", "1 1 0000010 100 00000000", "malformed length"),  # 11.1.3
    ("New", "1 1 0000010 100 00000010 11111111 00000000", "malformed length"),  # an octet too much inside
    ("New", "1 1 0000010 010 00000001 01100000", "malformed length"),  # padding inside that is not zero
    ("New", "1 1 0000010 100 00000010 11111111", "truncated"),
    ("Nothings", "11000001 11000100 11000100 11000100 11000100 11000100", "wrong size"),
]


@pytest.mark.parametrize(("name", "bits", "why"), BAD_OCTETS)
def test_what_is_malformed_is_refused(codec: Compiled, name: str, bits: str, why: str) -> None:
    with pytest.raises(RefusedError, match=why):
        codec.decode(name, octets_of(bits))


@pytest.mark.parametrize(("name", "value", "bits"), GOOD)
def test_octets_that_end_early_are_truncated(codec: Compiled, name: str, value: Any, bits: str) -> None:
    octets = octets_of(bits)
    for size in range(len(octets)):
        if name != "Empty":
            with pytest.raises(RefusedError, match="truncated"):
                codec.decode(name, octets[:size])


KEPT = [
    ("Old", "1 1 0000010 101 00000001 11111111 00000001 00000000"),  # additions of a later edition
    ("Old", "1 1 0000010 000"),  # none of them there, and yet the bit is set
    ("Old", "1 1 1 01000001 " + "0" * 64 + "1 00000001 10101010"),  # 11.9.3.4: a bitmap of 65
    ("New", "1 1 0000000 1 00000001 11111111"),  # a sender that knows the first addition only
    ("New", "1 1 0000011 1001 00000001 11111111 00000001 01010101"),
    ("Choose", "1 0000101 00000010 10101011 11001101"),  # the sixth addition
    ("Choose", "1 1 00000001 01000000 00000001 11111111"),
    ("Sparse", "1 0000101"),
    ("Open", "11111111 00000001 10101010"),
]


@pytest.mark.parametrize(("name", "bits"), KEPT)
def test_what_no_edition_knows_is_encoded_again_unchanged(codec: Compiled, name: str, bits: str) -> None:
    assert codec.again(name, octets_of(bits)) == octets_of(bits)


@pytest.mark.parametrize("count", [127, 128, 16383, 16384, 16385, 32768, 65535, 65536, 65536 + 16384 + 5, 131072])
def test_long_values_are_fragmented(codec: Compiled, count: int) -> None:
    # 11.9.3.6 to 11.9.3.8
    octets = bytes(range(256)) * (count // 256 + 1)
    text = octets[:count].hex().upper()
    bits = codec.bits("AnyOctets", text)
    assert bits == _fragmented(octets[:count])
    assert codec.decode("AnyOctets", octets_of(bits)) == text
    flags = [bool(octets[i] & 1) for i in range(count)]
    assert codec.decode("Many", octets_of(codec.bits("Many", flags))) == flags
    inside = codec.bits("Chosen", {"w": text})
    content = octets_of(bits)
    assert inside == "10000001" + _fragmented(content)
    assert codec.decode("Chosen", octets_of(inside)) == {"w": text}


def test_named_bits_are_filled_up_in_fragments(codec: Compiled) -> None:
    bits = codec.bits("Crowd", {"value": "A0", "length": 3})
    assert bits == "11000100" + "101" + "0" * 65533 + f"{0x8000 | 4464:016b}" + "0" * 4464
    assert bits == codec.bits("Crowd", {"value": "A0" + "00" * 8749, "length": 70000})
    codec.validate("Crowd", {"value": "A0", "length": 3})


def _fragmented(octets: bytes) -> str:
    bits = ""
    while len(octets) >= 16384:
        size = min(len(octets) // 16384, 4)
        bits += f"{0xC0 | size:08b}" + "".join(f"{o:08b}" for o in octets[: size * 16384])
        octets = octets[size * 16384 :]
    length = f"{len(octets):08b}" if len(octets) < 128 else f"{0x8000 | len(octets):016b}"
    return bits + length + "".join(f"{o:08b}" for o in octets)


@pytest.mark.parametrize(("name", "value", "bits"), GOOD)
def test_a_buffer_that_is_too_small_is_never_written_beyond(codec: Compiled, name: str, value: Any, bits: str) -> None:
    needed = len(octets_of(bits))
    for room in range(needed):
        with pytest.raises(RefusedError, match="buffer too small"):
            codec.bits(name, value, room)
    assert codec.bits(name, value, needed) == bits.replace(" ", "")


def test_a_count_is_not_believed_before_the_octets_are_there(codec: Compiled) -> None:
    # 65 536 elements are announced; the arena of 100 octets is never asked for them
    with pytest.raises(RefusedError, match="truncated"):
        codec.decode("Many", bytes.fromhex("c4ff"), memory=100)
    with pytest.raises(RefusedError, match="out of memory"):
        codec.decode("Many", bytes.fromhex("7f") + bytes(16), memory=100)


def test_a_type_inside_itself_has_a_bound(codec: Compiled) -> None:
    def nested(depth: int) -> Any:
        return {"here": 1, "more": nested(depth - 1)} if depth else {"here": 0}

    assert codec.bits("Deep", nested(31)) == "11" * 31 + "00"
    with pytest.raises(RefusedError, match="nested too deeply"):
        codec.bits("Deep", nested(32))
    with pytest.raises(RefusedError, match="nested too deeply"):
        codec.decode("Deep", b"\xff" * 100)


def test_a_choice_or_list_inside_itself_has_the_same_bound(codec: Compiled) -> None:
    choice: Any = {"leaf": 1}
    list_: Any = []
    for _ in range(31):
        choice, list_ = {"more": choice}, [list_]
    assert codec.bits("Nest", choice) == "1" * 31 + "01"
    assert codec.decode("Nests", octets_of(codec.bits("Nests", list_))) == list_
    for name, value in (("Nest", {"more": choice}), ("Nests", [list_])):
        with pytest.raises(RefusedError, match="nested too deeply"):
            codec.bits(name, value)
    for name, octet in (("Nest", b"\xff"), ("Nests", b"\1"), ("Branch", b"\x80\x64")):
        with pytest.raises(RefusedError, match=r"nested too deeply|truncated"):
            codec.decode(name, octet * 100_000)


def test_what_stands_beside_one_another_is_not_nested(codec: Compiled) -> None:
    value = [{"more": {"more": {"leaf": None}}}, {"[5]": "00"}] * 40
    octets = octets_of(codec.bits("Branches", value))
    assert codec.decode("Branches", octets) == value
    assert codec.again("Branches", octets) == octets


def test_a_default_of_named_bits_has_the_size_of_its_type(codec: Compiled) -> None:
    assert codec.decode("Signal", octets_of("00")) == {"some": "A0", "none": "00"}


def test_what_is_large_lies_behind_a_pointer(codec: Compiled) -> None:
    large = {"first": "01" * 64, "second": "02" * 64, "third": 3}
    value = {"large": large, "either": {"large": large}}
    octets = octets_of(codec.bits("Holder", value))
    assert codec.decode("Holder", octets) == value
    with pytest.raises(RefusedError, match="out of memory"):
        codec.decode("Holder", octets, memory=200)


REAL = json.loads((ROOT / "firmware" / "vectors.json").read_text())


@pytest.mark.parametrize(
    ("name", "standard"), [("cam-1.4.1", "CAM EN 302 637-2 v1.4.1"), ("denm-1.3.1", "DENM EN 302 637-3 v1.3.1")]
)
def test_real_messages_come_back_octet_for_octet(name: str, standard: str) -> None:
    codec = compiled(load_schema(), ["cam-1.4.1", "denm-1.3.1"])
    for vector in REAL:
        if vector["module"] == standard:
            octets = bytes.fromhex(vector["hex"])
            assert codec.again(name, octets) == octets


def test_no_octets_ask_for_more_memory_than_is_stated(codec: Compiled) -> None:
    # the arena ends where arena_octets says: whatever the octets are, it is never used up
    schema = schema_of(MODULE, *NAMES_OF_TYPES)
    layout = lay_out(schema, [schema.messages[name] for name in NAMES_OF_TYPES])
    random = Random(7)
    for name, pdu in layout.pdus.items():
        for size in range(1, 40):
            octets = random.randbytes(size) if size % 3 else bytes([random.randrange(64)]) + bytes(size - 1)
            try:
                codec.decode(name, octets, memory=arena_octets(pdu) * size)
            except RefusedError as error:
                assert str(error) not in ("out of memory", "buffer too small"), (name, octets.hex())


def test_the_same_schema_gives_the_same_octets(tmp_path: Path) -> None:
    schema = load_schema()
    first = library.generate(schema, ["cam-1.4.1"], tmp_path / "first")
    second = library.generate(schema, ["cam-1.4.1"], tmp_path / "second")
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert first == sorted(first)
