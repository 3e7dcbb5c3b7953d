"""A small schema that holds one of everything, for tests of what is made from a schema."""

from asn1.model.types import (
    BitString,
    Boolean,
    CharacterString,
    Choice,
    ClassField,
    Component,
    Constraint,
    Definition,
    Enumerated,
    Group,
    Integer,
    Message,
    Module,
    Named,
    ObjectClass,
    ObjectRow,
    ObjectSet,
    OpenType,
    Range,
    Reference,
    Schema,
    Sequence,
    SequenceOf,
    Size,
    Type,
    Values,
)


def numbers(low: int, high: int, is_extensible: bool = False) -> Constraint:
    return Constraint(Values((Range(low, high),)), is_extensible)


def size(low: int, high: int, is_extensible: bool = False) -> Constraint:
    return Constraint(Size(numbers(low, high, is_extensible)))


def here(name: str) -> Reference:
    return Reference(module="r9_demo", name=name)


SPEED = Integer(constraints=(numbers(0, 16383),), names=(Named("standstill", 0), Named("unavailable", 16383)))
LIGHTS = BitString(constraints=(size(3, 3),), names=(Named("low", 0), Named("high", 1)))
KIND = Enumerated(root=(Named("car", 0), Named("bus", 1)), is_extensible=True, additions=(Named("tram", 2),))
SHAPE = Choice(
    root=(Component("radius", Integer(constraints=(numbers(0, 255),))), Component("box", here("Box"))),
    is_extensible=True,
    additions=(Component("index", Boolean()),),
)
BOX = Sequence(
    root=(
        Component("width", Integer(constraints=(numbers(1, 8),)), default=2, unit="m"),
        Component("delete", Boolean()),
    )
)
PDU = Sequence(
    root=(
        Component("speed", here("Speed")),
        Component("slow", Reference(module="r9_demo", name="Speed", constraints=(numbers(0, 100),)), is_optional=True),
        Component("kind", KIND),
        Component("lights", here("Lights")),
        Component("shapes", SequenceOf(constraints=(size(0, 3, True),), element=here("Shape"))),
        Component("note", CharacterString(kind="UTF8String"), is_optional=True),
        Component("id", ClassField(class_=here("CLASS"), set_=here("Set"))),
        Component("content", OpenType(class_=here("CLASS"), set_=here("Set"), selector="id")),
    ),
    is_extensible=True,
    additions=(
        Component("late", Boolean()),
        Group((Component("first", Boolean()), Component("second", here("Box"), True))),
    ),
)


def schema() -> Schema:
    """Message demo-1.0.0: PDU r9_demo.Demo."""
    types: dict[str, tuple[Type, str | None]] = {
        "Demo": (PDU, None),
        "Speed": (SPEED, "0.01 m/s"),
        "Lights": (LIGHTS, None),
        "Shape": (SHAPE, None),
        "Box": (BOX, None),
    }
    module = Module(
        key="r9_demo",
        name="DEMO-PDU-Descriptions",
        oid="{itu-t(0) demo(9)}",
        standard="Demo TS 1 v1.0.0",
        source="demo.asn",
        sha256="0" * 64,
        definitions={name: Definition(name, type_, unit) for name, (type_, unit) in types.items()},
        classes={"CLASS": ObjectClass("CLASS", "&id", Integer(constraints=(numbers(0, 15),)), "&Type")},
        sets={"Set": ObjectSet("Set", here("CLASS"), (ObjectRow(1, here("Box")), ObjectRow(2, here("Speed"))))},
    )
    message = Message("demo-1.0.0", "demo", 9, "Demo TS 1 v1.0.0", here("Demo"), (99,), (1, 2), 2099, 1)
    return Schema({"r9_demo": module}, {"demo-1.0.0": message})
