"""Types: each construct of X.680 that the standards use becomes the type of the schema that says the same."""

import pytest

from asn1.model import types as t
from tests.asn1.importing import definition, imported, limited, module, ref


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("BOOLEAN", t.Boolean()),
        ("NULL", t.Null()),
        ("OCTET STRING", t.OctetString()),
        ("OBJECT IDENTIFIER", t.ObjectIdentifier()),
        ("RELATIVE-OID", t.ObjectIdentifier(is_relative=True)),
        ("UTF8String", t.CharacterString("UTF8String")),
        ("ISO646String", t.CharacterString("VisibleString")),
        ("INTEGER", t.Integer()),
        ("INTEGER (0..7)", t.Integer(constraints=(limited((0, 7)),))),
        ("INTEGER { a(1), b(-2) }", t.Integer(names=(t.Named("a", 1), t.Named("b", -2)))),
        ("BIT STRING { x(0), y(3) }", t.BitString(names=(t.Named("x", 0), t.Named("y", 3)))),
        ("SEQUENCE { }", t.Sequence(())),
        ("SEQUENCE OF NULL", t.SequenceOf(t.Null())),
        ("SET OF BOOLEAN", t.SequenceOf(t.Boolean(), is_set=True)),
    ],
)
def test_a_builtin_type_is_itself(text: str, expected: t.Type) -> None:
    assert definition(f"A ::= {text}") == expected


def test_components_keep_their_order_and_their_ellipses() -> None:
    text = "A ::= SEQUENCE { a NULL, ..., b NULL OPTIONAL, [[ c NULL, d BOOLEAN ]], [[4: e NULL ]], ..., f BOOLEAN }"
    null, boolean = t.Null(), t.Boolean()
    assert definition(text) == t.Sequence(
        root=(t.Component("a", null),),
        is_extensible=True,
        additions=(
            t.Component("b", null, is_optional=True),
            t.Group((t.Component("c", null), t.Component("d", boolean))),
            t.Group((t.Component("e", null),), version=4),
        ),
        tail=(t.Component("f", boolean),),
    )


def test_components_of_another_sequence_take_their_place_without_its_additions() -> None:
    # X.680 25.5
    found = definition("A ::= SEQUENCE { x NULL, COMPONENTS OF B, y NULL }  B ::= SEQUENCE { b BOOLEAN, ..., c NULL }")
    assert isinstance(found, t.Sequence)
    assert [one.name for one in found.root] == ["x", "b", "y"]


def test_components_of_a_sequence_in_another_module_keep_its_names() -> None:
    text = module("A ::= SEQUENCE { COMPONENTS OF B }", imports="IMPORTS B FROM N;")
    text += module("B ::= SEQUENCE { b C }  C ::= NULL", name="N")
    found = imported(text)["m"].definitions["A"].type
    assert found == t.Sequence((t.Component("b", ref("C", "n")),))


def test_enumeration_items_get_numbers_where_the_text_gives_none() -> None:
    # X.680 20.3 and its example in 20.8
    found = definition("A ::= ENUMERATED { a, b(3), c, ..., d, e(9), f }")
    assert found == t.Enumerated(
        (t.Named("a", 0), t.Named("c", 1), t.Named("b", 3)),
        is_extensible=True,
        additions=(t.Named("d", 2), t.Named("e", 9), t.Named("f", 10)),
    )


def test_alternatives_without_tags_keep_their_order() -> None:
    found = definition("A ::= CHOICE { b BOOLEAN, a INTEGER, ..., c NULL }")
    assert isinstance(found, t.Choice)
    assert [one.name for one in found.root] == ["b", "a"]
    assert found.is_extensible
    assert found.additions == (t.Component("c", t.Null()),)


def test_alternatives_with_tags_stand_in_the_order_of_their_tags() -> None:
    # X.680 8.6: universal, application, context, private; then by number
    body = "A ::= CHOICE { p [PRIVATE 0] NULL, c [2] NULL, b [1] NULL, u INTEGER, a [APPLICATION 9] NULL }"
    found = definition(body)
    assert isinstance(found, t.Choice)
    assert [one.name for one in found.root] == ["u", "a", "b", "c", "p"]


def test_without_automatic_tags_alternatives_stand_in_the_order_of_their_universal_tags() -> None:
    text = module(
        "A ::= CHOICE { s SEQUENCE {}, e ENUMERATED {x}, i B, n NULL, c C }  B ::= INTEGER  C ::= CHOICE { b BOOLEAN }",
        tags="EXPLICIT TAGS",
    )
    found = imported(text)["m"].definitions["A"].type
    assert isinstance(found, t.Choice)
    assert [one.name for one in found.root] == ["c", "i", "n", "e", "s"]


def test_value_references_become_their_numbers_through_modules() -> None:
    text = module("A ::= INTEGER (low..high) low INTEGER ::= -3", imports="IMPORTS high FROM N;")
    text += module("high INTEGER ::= other other INTEGER ::= 12", name="N")
    assert imported(text)["m"].definitions["A"].type == t.Integer(constraints=(limited((-3, 12)),))


def test_what_no_message_reaches_is_not_there() -> None:
    assert list(imported(module("A ::= B  B ::= NULL  C ::= REAL"))["m"].definitions) == ["A", "B"]


def test_definitions_stand_in_the_order_of_the_text() -> None:
    assert list(imported(module("C ::= NULL  B ::= C  A ::= B"))["m"].definitions) == ["C", "B", "A"]


def test_a_type_may_recur() -> None:
    found = definition("A ::= SEQUENCE { a A OPTIONAL }")
    assert found == t.Sequence((t.Component("a", ref("A"), is_optional=True),))


@pytest.mark.parametrize(
    ("type_", "default", "expected"),
    [
        ("BOOLEAN", "FALSE", False),
        ("INTEGER (0..9)", "3", 3),
        ("ENUMERATED { x, y }", "y", "y"),
        ("OCTET STRING", "'0aFF'H", b"\x0a\xff"),
        ("BIT STRING", "'0101'B", (b"\x50", 4)),
        ("BIT STRING", "'F0'H", (b"\xf0", 8)),
        ("BIT STRING { p(0), q(2) }", "{ p, q }", (b"\xa0", 3)),
        ("BIT STRING", "''B", (b"", 0)),
        ("IA5String", '"it ""is"""', 'it "is"'),
    ],
)
def test_a_default_is_a_value_of_its_type(type_: str, default: str, expected: t.Default) -> None:
    found = definition(f"A ::= SEQUENCE {{ a {type_} DEFAULT {default.upper() if 'H' in default else default} }}")
    assert isinstance(found, t.Sequence)
    assert found.root[0].default == expected
    assert type(found.root[0].default) is type(expected)
