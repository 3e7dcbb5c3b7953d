"""Classes, object sets, and templates with actual parameters."""

from asn1.model import types as t
from tests.asn1.importing import definition, imported, limited, module, problems, ref
from tests.said import tells

CLASS = "CLS ::= CLASS { &id Id UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }  Id ::= INTEGER (0..255)"
TABLE = "B ::= SEQUENCE { key CLS.&id({S}), value CLS.&Type({S}{@key}) }"


def test_a_table_constraint_names_class_set_and_selector() -> None:
    found = imported(module(f"A ::= B {TABLE} {CLASS} S CLS ::= {{ {{NULL IDENTIFIED BY 3}}, ... }}"))["m"]
    assert found.definitions["B"].type == t.Sequence(
        (
            t.Component("key", t.ClassField(ref("CLS"), ref("S"))),
            t.Component("value", t.OpenType(ref("CLS"), ref("S"), "key")),
        )
    )
    assert found.classes["CLS"] == t.ObjectClass("CLS", "&id", ref("Id"), "&Type")
    assert found.sets["S"] == t.ObjectSet("S", ref("CLS"), (t.ObjectRow(3, t.Null()),), is_extensible=True)


def test_rows_may_follow_the_ellipsis_and_other_sets_may_be_part() -> None:
    body = f"A ::= B {TABLE} {CLASS} S CLS ::= {{ T | {{NULL IDENTIFIED BY two}}, ..., {{BOOLEAN IDENTIFIED BY 3}} }}"
    found = imported(module(body + " T CLS ::= { {A IDENTIFIED BY 1} }  two Id ::= 2"))["m"]
    assert found.sets["S"].rows == (t.ObjectRow(1, ref("A")), t.ObjectRow(2, t.Null()), t.ObjectRow(3, t.Boolean()))
    assert "T" not in found.sets


def test_rows_of_a_class_without_syntax_name_their_fields() -> None:
    body = f"A ::= B {TABLE} CLS ::= CLASS {{ &id INTEGER, &Type }}  S CLS ::= {{ {{&id 4, &Type NULL}} }}"
    assert imported(module(body))["m"].sets["S"].rows == (t.ObjectRow(4, t.Null()),)


def test_a_selector_may_begin_with_a_point() -> None:
    table = TABLE.replace("@key", "@.key")
    assert imported(module(f"A ::= B {table} {CLASS} S CLS ::= {{ ... }}"))["m"].sets["S"].rows == ()


def test_a_constraint_on_an_identifier_field_knows_its_names() -> None:
    body = f"A ::= B (WITH COMPONENTS {{..., key (ALL EXCEPT 1)}}) {TABLE} {CLASS} S CLS ::= {{ ... }}"
    inner = t.Inner(True, (t.InnerComponent("key", t.Constraint(t.AllExcept(limited(1).root)), None),))
    assert definition(body) == ref("B", "m", t.Constraint(inner))


def test_every_instance_of_a_template_is_a_definition_of_its_own() -> None:
    body = f"A ::= SEQUENCE {{ a T {{{{S1}}}}, b T {{{{S2}}}}, c T {{{{S1}}}} }} {CLASS}"
    body += " T {CLS : Set} ::= SEQUENCE { key CLS.&id({Set}), value CLS.&Type({Set}{@key}) }"
    found = imported(module(body + " S1 CLS ::= { ... }  S2 CLS ::= { {NULL IDENTIFIED BY 1} }"))["m"]
    assert [*found.definitions] == ["A", "Id", "T-S1", "T-S2"]
    second = found.definitions["T-S2"].type
    assert isinstance(second, t.Sequence)
    assert second.root[0].type == t.ClassField(ref("CLS"), ref("S2"))


def test_types_and_numbers_are_parameters_too() -> None:
    body = "A ::= T { B, 5 }  T { Type, INTEGER : size } ::= SEQUENCE (SIZE(1..size)) OF Type  B ::= NULL"
    found = imported(module(body))["m"].definitions
    assert found["A"].type == ref("T-B-5")
    assert found["T-B-5"].type == t.SequenceOf(ref("B"), constraints=(t.Constraint(t.Size(limited((1, 5)))),))


def test_a_template_hands_its_parameters_on() -> None:
    body = "A ::= Outer { B }  Outer { X } ::= SEQUENCE { x Inner { X } }  Inner { Y } ::= SEQUENCE { y Y }  B ::= NULL"
    found = imported(module(body))["m"].definitions
    assert found["Outer-B"].type == t.Sequence((t.Component("x", ref("Inner-B")),))
    assert found["Inner-B"].type == t.Sequence((t.Component("y", ref("B")),))


def test_a_set_of_another_module_is_found_by_who_names_it() -> None:
    text = module("A ::= T {{S}}", imports="IMPORTS T, CLS FROM N;")
    text = text.replace("\nEND", " S CLS ::= { {NULL IDENTIFIED BY 1} }\nEND")
    text += module(
        f"T {{CLS : Set}} ::= SEQUENCE {{ key CLS.&id({{Set}}), v CLS.&Type({{Set}}{{@key}}) }} {CLASS}", "N"
    )
    found = imported(text)
    instance = found["n"].definitions["T-S"].type
    assert isinstance(instance, t.Sequence)
    assert instance.root[0].type == t.ClassField(ref("CLS", "n"), ref("S", "m"))


def test_a_template_with_too_few_parameters_is_refused() -> None:
    text = module("A ::= T { NULL }\nT { X, Y } ::= SEQUENCE { x X, y Y }")
    assert problems(text) == ["m.asn:2: T has 2 parameters; the reference gives 1 (X.683 9.6)"]


def test_rows_with_one_identifier_are_refused() -> None:
    rows = "{NULL IDENTIFIED BY 1} | {BOOLEAN IDENTIFIED BY 1}"
    text = module(f"A ::= B {TABLE} {CLASS}\nS CLS ::= {{ {rows} }}")
    (why,) = problems(text)
    assert tells(why, "m.asn:3: ", "rows of S ", "same identifier", "(X.681 12.8)")
