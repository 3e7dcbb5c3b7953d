"""Stub captain_messages.pyi: types for mypy and editors.

Every SEQUENCE has a TypedDict (result of decode, argument of encode) and a class of views with the same names. Both
exist for type checkers only. Enumerations are literals, a CHOICE is a union of pairs.
"""

import keyword
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

from asn1.layout.layout import Field, Kind, Layout, Node
from asn1.model.types import Message

NAME = "captain_messages.pyi"
HEAD = Path(__file__).parent / "head.pyi.in"
ROS2 = Path(__file__).parent / "ros2" / "ros2.pyi.in"  # contains classes, two blank lines, and methods of Message
INTEGERS = {Kind.INTEGER: "int", Kind.BOOLEAN: "bool", Kind.NULL: "None"}
LEAVES = INTEGERS | {
    Kind.SMALL_BITS: "tuple[bytes, int]",
    Kind.BIT_STRING: "tuple[bytes, int]",
    Kind.FIXED_OCTETS: "bytes",
    Kind.OCTET_STRING: "bytes",
    **dict.fromkeys(
        (Kind.IA5, Kind.VISIBLE, Kind.PRINTABLE, Kind.NUMERIC, Kind.UTF8, Kind.OID, Kind.RELATIVE_OID), "str"
    ),
}
NAMED = (Kind.SEQUENCE, Kind.CHOICE, Kind.ENUMERATED)
Around: TypeAlias = frozenset[Node]


def write(layout: Layout, folder: Path, with_cdr: bool = False) -> None:
    """Write captain_messages.pyi to the folder of the module."""
    (folder / NAME).write_text(text(layout, with_cdr), encoding="utf-8")


def text(layout: Layout, with_cdr: bool = False) -> str:
    """Return the stub; the same layout gives the same text. with_cdr: the module also converts ROS 2 messages."""
    head = HEAD.read_text(encoding="utf-8")
    if with_cdr:
        classes, _, methods = ROS2.read_text(encoding="utf-8").partition("\n\n\n")
        head = head.replace("class Message(", f"{classes}\n\nclass Message(")
        head = head.replace(
            "    def type_tree(self) -> Type: ...\n", f"    def type_tree(self) -> Type: ...\n{methods}"
        )
    lines = [head]
    for key in sorted(layout.nodes):
        for node in sorted(layout.nodes[key], key=lambda node: node.c_name):
            lines.extend(_definition(node) if node.form_of is None else ())
    lines.extend(_finds(layout))
    return "\n".join(lines) + "\n"


def _definition(node: Node) -> Iterator[str]:
    match node.kind:
        case Kind.ENUMERATED:
            yield f"{node.c_name}: TypeAlias = {_items(node)}"
        case Kind.CHOICE:
            yield f"{node.c_name}: TypeAlias = {_alternatives(node)}"
        case Kind.SEQUENCE:
            yield from _dict(node)
            yield from _view(node)


def _items(node: Node) -> str:
    names = ", ".join(f'"{item.name}"' for item in node.names)
    return f"Literal[{names}]" + (" | int" if node.is_extensible else "")


def _alternatives(node: Node) -> str:
    pairs = [f'tuple[Literal["{field.name}"], {_value(field.node)}]' for field in node.fields]
    if node.is_extensible:
        pairs.append("tuple[str, bytes]")
    return " | ".join(pairs)


def _dict(node: Node) -> Iterator[str]:
    if all(field.name.isidentifier() and not keyword.iskeyword(field.name) for field in node.fields):
        yield f"class {node.c_name}(TypedDict):"
        for field in node.fields:
            yield f"    {field.name}: {_member(field)}"
        if not node.fields:
            yield "    pass"
        return
    yield f"{node.c_name} = TypedDict({_quoted(node.c_name)}, {{"
    for field in node.fields:
        yield f"    {_quoted(field.name)}: {_member(field)},"
    yield "})"


def _quoted(name: str) -> str:
    return f'"{name}"'


def _member(field: Field) -> str:
    value = _value(field.node)
    return f"NotRequired[{value}]" if field.is_optional else value


def _view(node: Node) -> Iterator[str]:
    yield f"class {node.c_name}_View(RecordView[{node.c_name}]):"
    for field in node.fields:
        absent = " | None" if field.is_optional and field.default is None else ""
        yield f"    @property\n    def {attribute(field.name)}(self) -> {_seen(field.node)}{absent}: ..."
    if not node.fields:
        yield "    pass"


def attribute(name: str) -> str:
    """Return a component's name as attribute: the ASN.1 name, unless it is a keyword of Python."""
    name = name.replace("-", "_")
    return f"{name}_" if keyword.iskeyword(name) else name


def _value(node: Node, around: Around = frozenset()) -> str:
    """Return the type of a value in a dict. around: enclosing types; inside itself a type becomes Any."""
    if node in around:
        return "Any"
    inside = around | {node}
    match node.kind:
        case kind if kind in NAMED:
            return node.c_name
        case Kind.LIST:
            return f"list[{_value(node.item, inside)}]"
        case Kind.OPEN:
            return " | ".join(dict.fromkeys([*(_value(row, inside) for _, row in node.rows), "bytes"]))
        case kind:
            return LEAVES[kind]


def _seen(node: Node, around: Around = frozenset()) -> str:
    """Return the type of a value in a view. around: as in `_value`."""
    if node in around:
        return "Any"
    inside = around | {node}
    match node.kind:
        case Kind.SEQUENCE:
            return f"{node.c_name}_View"
        case Kind.CHOICE:
            values = dict.fromkeys(
                [*(_seen(field.node, inside) for field in node.fields), *(["bytes"] if node.is_extensible else [])]
            )
            return f"ChoiceView[{node.c_name}, {' | '.join(values)}]"
        case Kind.LIST:
            return f"ListView[{_value(node.item, inside)}, {_seen(node.item, inside)}]"
        case Kind.OPEN:
            return " | ".join(dict.fromkeys([*(_seen(row, inside) for _, row in node.rows), "bytes"]))
        case _:
            return _value(node)


def _finds(layout: Layout) -> Iterator[str]:
    """Yield overloads of find() and example() for each name, and for each type: its edition of smallest rank."""
    names: dict[str, Message] = {message.name: message for message in layout.messages}
    for message in sorted(layout.messages, key=lambda message: message.rank):
        names.setdefault(message.type, message)
    for name in sorted(names):
        node = layout.pdus[names[name].name]
        node = node.form_of or node
        literal = f"name: Literal[{_quoted(name)}], /"
        yield f"@overload\ndef find({literal}) -> Message[{_value(node)}, {_seen(node)}]: ..."
        yield f"@overload\ndef example({literal}, **fields: str | float) -> {_value(node)}: ..."
    yield "@overload\ndef find(name: str, /) -> Message[Any, Any]: ..."
    yield "@overload\ndef example(name: str, /, **fields: str | float) -> Any: ..."
