"""The schema as ASN.1 text: it says the same as what it was made from, and other compilers take it."""

import pytest

from asn1.backends.asn import text as asn
from asn1.model import types as t
from tests.asn1.imported import imported, snippet
from tests.asn1.reach import pruned
from tests.asn1.truth import schema

MESSAGES = sorted(schema().messages)
EVERYTHING = """
    Speed ::= INTEGER { standstill(0) } (0..16383)
    Gap ::= INTEGER (0..3 | 7, ..., 9)
    Open ::= INTEGER (MIN..5)
    Item ::= ENUMERATED { a(0), b(4), ..., c(2) }
    Flags ::= BIT STRING { first(0), third(2) } (SIZE (3, ...))
    Text ::= IA5String (SIZE (1..8)) (FROM ("A".."Z" | " "))
    Oid ::= OBJECT IDENTIFIER
    Path ::= SEQUENCE SIZE (1..8, ...) OF Speed
    Short ::= Path (SIZE (2..4))
    Even ::= Path (WITH COMPONENT (ALL EXCEPT 1))
    Set ::= SET OF BOOLEAN
    Holds ::= OCTET STRING (CONTAINING Speed)
    ID-AND-TYPE ::= CLASS { &id Id UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }
    Id ::= INTEGER (0..255)
    Rows ID-AND-TYPE ::= { { Speed IDENTIFIED BY 1 } | { BOOLEAN IDENTIFIED BY 2 }, ... }
    Extension ::= SEQUENCE { id ID-AND-TYPE.&id ({Rows}), value ID-AND-TYPE.&Type ({Rows}{@id}) }
    Root ::= SEQUENCE {
        speed Speed DEFAULT 5, flag BOOLEAN DEFAULT TRUE, item Item DEFAULT b, bits Flags DEFAULT '101'B,
        text Text DEFAULT "AB", octets OCTET STRING DEFAULT 'A0'H, gap Gap OPTIONAL, open Open, oid Oid, short Short,
        chosen CHOICE { one NULL, two SEQUENCE { inside Set }, ..., three Holds, [[ four Even ]] },
        partial Extension (WITH COMPONENTS { ..., id (1), value PRESENT }),
        ..., later NULL OPTIONAL, [[ 2: extension Extension OPTIONAL, last BOOLEAN ]], ..., tail Speed
    }
"""


@pytest.mark.parametrize("name", MESSAGES)
def test_what_a_message_reaches_comes_back_from_its_text_as_it_was(name: str):
    message = schema().messages[name]
    only = pruned(schema(), message.pdu)
    again = imported({key: asn.text(only, module) for key, module in only.modules.items()}, message.pdu)
    assert {key: _said(module) for key, module in again.modules.items()} == {
        key: _said(module) for key, module in only.modules.items()
    }


def test_every_construct_comes_back_from_its_text_as_it_was():
    first, root = snippet(EVERYTHING, "Root")
    again = imported({"r1_test": asn.text(first, first.modules["r1_test"])}, root)
    assert _said(again.modules["r1_test"]) == _said(first.modules["r1_test"])
    assert len(first.modules["r1_test"].definitions) == 15


def test_what_pycrate_does_not_understand_is_left_out_for_it_alone():
    first, _ = snippet(EVERYTHING, "Root")
    module = first.modules["r1_test"]
    assert "WITH COMPONENT" in asn.text(first, module)
    assert "WITH COMPONENT" not in asn.text(first, module, "pycrate")


def test_asn1tools_gets_octets_for_a_relative_object_identifier():
    first, _ = snippet("Root ::= SEQUENCE { oid RELATIVE-OID }", "Root")
    module = first.modules["r1_test"]
    assert "oid RELATIVE-OID" in asn.text(first, module)
    assert "oid OCTET STRING" in asn.text(first, module, "asn1tools")


def test_symbols_of_one_name_from_two_modules_are_told_apart():
    speed = t.Definition("Speed", t.Integer())
    root = t.Definition(
        "Root", t.Sequence(tuple(t.Component(key, t.Reference(key, "Speed")) for key in ("a", "b", "c")))
    )
    modules = {
        key: t.Module(key, key.upper(), "", "", "", "", {one.name: one for one in definitions})
        for key, definitions in {"a": [speed, root], "b": [speed], "c": [speed]}.items()
    }
    text = asn.text(t.Schema(modules, {}), modules["a"])
    assert [line.strip(" ,") for line in text.splitlines() if line.startswith("  ")] == [
        "a Speed", "b B.Speed", "c C.Speed",
    ]  # fmt: skip


def test_a_list_without_a_name_has_one_constraint_at_most():
    twice = (t.Constraint(t.Size(t.Constraint(t.Values((t.Range(1, 2),))))),) * 2
    module = t.Module(
        "a", "A", "", "", "", "", {"Root": t.Definition("Root", t.SequenceOf(t.Null(), constraints=twice))}
    )
    with pytest.raises(ValueError, match=r"2 constraints; ASN\.1 can write one"):
        asn.text(t.Schema({"a": module}, {}), module)


def test_writing_gives_one_file_per_module(tmp_path):
    only = pruned(schema(), schema().messages["cam-1.4.1"].pdu)
    assert [path.name for path in asn.write(only, tmp_path / "text")] == [f"{key}.asn" for key in only.modules]


def _said(module: t.Module) -> tuple[object, ...]:
    """All but the document and the file that it was in."""
    return module.name, module.oid, module.definitions, module.classes, module.sets
