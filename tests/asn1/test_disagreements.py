"""Disagreements of codecs, decided by X.680 and X.691, with octets by hand.

Each row of disagreements.TABLE has an example here, on which all other codecs are right. A corrected codec fails its
test: remove its row then.
"""

from typing import Any, NamedTuple

import asn1tools
import pytest

from asn1.backends.asn import text as asn
from tests.asn1 import oracles
from tests.asn1.disagreements import TABLE, Constructs, explained
from tests.asn1.effective import effective
from tests.asn1.imported import snippet
from tests.asn1.oracles import Asn1tools, Oracle, Pycrate
from tests.asn1.reference import Encoder

PATH = "Path ::= SEQUENCE SIZE (1..8) OF BOOLEAN "
LONGER = "Path ::= SEQUENCE SIZE (1..8, ...) OF INTEGER (0..3) "


OPEN = """
    C ::= CLASS { &id Id UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }
    Id ::= INTEGER (0..7)
    Rows C ::= { ... }
    Root ::= SEQUENCE { id C.&id ({Rows}), value C.&Type ({Rows}{@id}) }
"""

GDD = """
    GddStructure ::= SEQUENCE { category CHOICE {
        sign ENUMERATED { danger, ... }, facility ENUMERATED { any, ... }, road ENUMERATED { dry, wet, ... }, ... } }
"""

POLYGONAL = "PolygonalShape ::= SEQUENCE { polygon SEQUENCE (SIZE (3..16, ...)) OF BOOLEAN }"
LANE = "LaneAttributes-addGrpC ::= SEQUENCE { maxVehicleHeight INTEGER (0..127) OPTIONAL, ... }"


class Example(NamedTuple):
    """octets in binary, grouped as the clauses give them; the rest of the last octet is zero."""

    construct: str
    text: str
    value: Any
    bits: str


EXAMPLES = (
    Example("union of ranges", "Root ::= INTEGER (0..2 | 5)", 5, "101"),
    # One bit tells 3 from 4.
    Example("SIZE on a reference", PATH + "Root ::= SEQUENCE { path Path (SIZE (3..4)) }", {"path": [True, False, True]},
            "0 1 0 1"),
    # No extension bit, one of eight lengths, one element.
    Example("serial constraint without marker", LONGER + "Root ::= SEQUENCE { path Path (WITH COMPONENT (0..2)) }",
            {"path": [1]}, "000 01"),
    Example("BOOLEAN default on a reference", "Flag ::= BOOLEAN Root ::= SEQUENCE { flag Flag DEFAULT TRUE }",
            {"flag": True}, "0"),
    # Extended; two additions, the second is there; an octet of it.
    Example("absent mandatory addition", "Root ::= SEQUENCE { ..., a BOOLEAN, b BOOLEAN }", {"b": True},
            "1 0000001 01 00000001 10000000"),
    Example("empty open type", "Root ::= SEQUENCE { ..., n NULL }", {"n": None}, "1 0000000 1 00000001 00000000"),
    Example("empty open type", "Root ::= CHOICE { a BOOLEAN, ..., n NULL }", ("n", None), "1 0000000 00000001 00000000"),
    Example("size outside of the root", "Root ::= BIT STRING (SIZE (1..2, ...))", (b"\xa0", 3), "1 00000011 101"),
    Example("size outside of the root", "Root ::= IA5String (SIZE (1..2, ...))", "AAA",
            "1 00000011 1000001 1000001 1000001"),
    # What exceeds the lower bound, in as few octets as hold it, without a sign.
    Example("semi-constrained INTEGER", "Root ::= INTEGER (-5..MAX)", 200, "00000001 11001101"),
    # As an INTEGER of any size: its length, and two's complement, whose sign takes an octet here.
    Example("INTEGER beyond 32 bits", "Root ::= INTEGER (0..3, ...)", 1 << 31, "1 00000101 00000000 1" + "0" * 31),
    Example("identifier of no row", OPEN, {"id": 5, "value": b"\x0f"}, "101 00000001 00001111"),
    # The marker's bit, the third of three, an item without additions of its own.
    Example("category of a GddStructure", GDD + "Root ::= SEQUENCE { code GddStructure }",
            {"code": {"category": ("road", "wet")}}, "0 10 0 1"),
    # The marker's bit, four more than three of fourteen lengths, in four bits.
    Example("polygon of a PolygonalShape", POLYGONAL + " Root ::= SEQUENCE { shape PolygonalShape }",
            {"shape": {"polygon": [True] * 7}}, "0 0100 1111111"),
    # The marker's bit, that of the component, 24 from 0 on.
    Example("maxVehicleHeight of module AddGrpC", LANE + " Root ::= SEQUENCE { lane LaneAttributes-addGrpC }",
            {"lane": {"maxVehicleHeight": 24}}, "0 1 0011000"),
    Example("SIZE of a UTF8String", "Root ::= UTF8String (SIZE (1..24))", "\u00e9", "00000010 11000011 10101001"),
    Example("DELETE in an IA5String", "Root ::= IA5String", "\x7f", "00000001 1111111"),
    Example("group of three with a mandatory one",
            "Root ::= SEQUENCE { ..., [[ a BOOLEAN, b BOOLEAN OPTIONAL, c BOOLEAN OPTIONAL ]] }",
            {"a": True, "b": True, "c": False}, "1 0000000 1 00000001 11 1 1 0 000"),
    # Two elements; the first has one, which has none; the second has none.
    Example("type within itself", "Item ::= SEQUENCE { items SEQUENCE OF Item } Root ::= SEQUENCE { item Item }",
            {"item": {"items": [{"items": [{"items": []}]}, {"items": []}]}}, "00000010 00000001 00000000 00000000"),
    # A fragment of 16 K, and nothing behind it.
    Example("bits or UTF-8 in fragments", "Root ::= BIT STRING", (b"\xff" * 2048, 16384), "11000001" + "1" * 16384 + "00000000"),
    Example("bits or UTF-8 in fragments", "Root ::= UTF8String", "@" * 16384, "11000001" + "01000000" * 16384 + "00000000"),
    # 16384 octets and their own length: a fragment of 16 K, then the two octets that are left.
    Example("open type of 16384 octets and more", "Root ::= SEQUENCE { ..., o OCTET STRING }", {"o": b"\xff" * 16384},
            "1 0000000 1" + "11000001" + "11000001" + "1" * 8 * 16383 + "00000010" + "11111111" + "00000000"),
)  # fmt: skip
IDS = [f"{one.construct}-{index}" for index, one in enumerate(EXAMPLES)]


def octets(bits: str) -> bytes:
    digits = bits.replace(" ", "")
    return int(digits.ljust(-(-len(digits) // 8) * 8, "0"), 2).to_bytes(-(-len(digits) // 8), "big")


def test_every_disagreement_has_an_example():
    assert {one.construct for one in EXAMPLES} == {row.construct for row in TABLE}


@pytest.mark.parametrize("example", EXAMPLES, ids=IDS)
def test_the_text_of_the_standards_decides(example: Example):
    schema, root = snippet(example.text, "Root")
    assert Encoder(schema).encode(root, example.value) == octets(example.bits)
    assert Constructs(schema).of(root, example.value) == {example.construct}


@pytest.mark.parametrize("example", EXAMPLES, ids=IDS)
def test_asn1tools_is_wrong_where_the_table_says_so_and_nowhere_else(example: Example):
    schema, root = snippet(example.text, "Root")
    assert is_right(Asn1tools(schema, root), example) == ("asn1tools" not in wrong(example))


@pytest.mark.parametrize("example", EXAMPLES, ids=IDS)
def test_pycrate_is_wrong_where_the_table_says_so_and_nowhere_else(example: Example):
    schema, root = snippet(example.text, "Root")
    assert is_right(Pycrate(schema, root), example) == ("pycrate" not in wrong(example))


@pytest.mark.parametrize(
    "example", [one for one in EXAMPLES if any(row.is_healed for row in TABLE if row.construct == one.construct)]
)
def test_a_constraint_in_its_effective_form_is_read_rightly_by_all(example: Example):
    schema, root = snippet(example.text, "Root")
    assert is_right(Asn1tools(effective(schema), root), example)
    assert is_right(Pycrate(effective(schema), root), example)


def test_a_row_of_one_version_explains_nothing_of_another():
    construct = "polygon of a PolygonalShape"
    assert explained("tshark 4.4", {construct}, is_healed=False) == [construct]
    assert explained("tshark 4.0", {construct}, is_healed=False) == []
    for name in ("tshark 4.0", "tshark 4.4"):
        assert explained(name, {"SIZE of a UTF8String"}, is_healed=False) == ["SIZE of a UTF8String"]


def test_asn1tools_reads_a_default_by_name_as_text():
    # X.680 25.9: the value of `still` is 2. The schema's own text has the number.
    text = "A DEFINITIONS AUTOMATIC TAGS ::= BEGIN S ::= INTEGER { still(2) } (0..3) R ::= SEQUENCE { s S DEFAULT still } END"
    assert asn1tools.compile_string(text, "uper").decode("R", b"\0") == {"s": "still"}


@pytest.mark.parametrize(
    ("text", "message"),
    [("CHOICE { a NULL, ... }", "80020102"), ("ENUMERATED { a, ... }", "80"), ("SEQUENCE { ... }", "8080ff80")],
)
def test_asn1tools_cannot_give_back_what_a_newer_sender_added(text: str, message: str):
    specification = asn1tools.compile_string(f"A DEFINITIONS AUTOMATIC TAGS ::= BEGIN R ::= {text} END", "uper")
    try:
        again = specification.encode("R", specification.decode("R", bytes.fromhex(message)), check_types=False)
    except Exception:  # noqa: BLE001
        return
    assert again != bytes.fromhex(message)


def test_pycrate_sends_trailing_zeros_of_named_bits():
    # X.691 16.2: they mean nothing. Made values have none, so that the table has no row of it.
    schema, root = snippet("Root ::= BIT STRING { first(0), last(7) }", "Root")
    assert Encoder(schema).encode(root, (b"\x80", 8)) == octets("00000001 1")
    theirs = Pycrate(schema, root)
    assert theirs.encode(theirs.shape((b"\x80", 8))) == octets("00001000 10000000")


def test_pycrate_does_not_parse_a_union_of_inner_constraints():
    text = "Root ::= SEQUENCE { a NULL OPTIONAL, b NULL OPTIONAL } ((WITH COMPONENTS {a PRESENT}) | (WITH COMPONENTS {b PRESENT}))"
    schema, root = snippet(text, "Root")
    as_it_is = asn.text(schema, schema.modules[root.module])
    with pytest.raises(Exception, match="invalid value reference"):
        oracles.generated(as_it_is)
    assert is_right(Pycrate(schema, root), Example("", "", {"a": None}, "10"))


def test_a_size_with_additions_keeps_its_root_apart():
    # X.691 20.4, 20.5: asn1c codes SIZE (1..32, ..., 100) as 1..100, and fails on real IVIMs.
    schema, root = snippet("Root ::= SEQUENCE (SIZE (1..32, ..., 100)) OF BOOLEAN", "Root")
    encode = Encoder(schema).encode
    assert encode(root, [True]) == octets("0 00000 1")
    assert encode(root, [True] * 100) == octets("1 01100100" + "1" * 100)


def is_right(oracle: Oracle, example: Example) -> bool:
    try:
        shaped = oracle.shape(example.value)
        return oracle.encode(shaped) == octets(example.bits) and oracle.decode(octets(example.bits)) == shaped
    except Exception:  # noqa: BLE001
        return False


def wrong(example: Example) -> set[str]:
    return {codec for row in TABLE if row.construct == example.construct for codec in row.codecs}
