"""Where in a C struct what a field of a ROS message is about lies: the way of a path through the layout."""

from collections.abc import Set
from typing import NamedTuple

from asn1.c.names import member
from asn1.nodes import STRUCTS, Field, Kind, Node
from asn1.ros2.model import Path


class Step(NamedTuple):
    """One step of a path, into a component, an alternative or a row that may be something else at the time.

    path       up to here
    holder     C of what holds it
    node       of what holds it
    number     of the field or row, from 0
    condition  C that says whether it is there; "" where it always is
    place      C of it
    """

    path: Path
    holder: str
    node: Node
    number: int
    condition: str
    place: str

    @property
    def field(self) -> Field:
        return self.node.fields[self.number]

    @property
    def child(self) -> Node:
        return self.node.rows[self.number][1] if self.node.kind is Kind.OPEN else self.field.node


class Place(NamedTuple):
    """The end of a path: its C, its type, and what has to be the case for it to be there."""

    place: str
    node: Node
    steps: tuple[Step, ...]

    @property
    def condition(self) -> str:
        """C; "" where it is always there."""
        return " && ".join(step.condition for step in self.steps if step.condition)


def follow(node: Node, place: str, path: Path, flags: Set[Path] = frozenset()) -> Place:
    """Where a path leads from a value.

    flags  paths of what a field says is there: among those with a DEFAULT these are asked, others are always there

    Raises KeyError where it leads to nothing.
    """
    steps = []
    for depth, name in enumerate(path, 1):
        step = _step(node, place, name, path[:depth], flags)
        steps.append(step)
        node, place = step.child, step.place
    return Place(place, node, tuple(steps))


def _step(node: Node, place: str, name: str, path: Path, flags: Set[Path]) -> Step:
    if node.kind is Kind.OPEN:
        index = next(k for k, (number, _) in enumerate(node.rows) if str(number) == name)
        row = node.rows[index][1]
        condition = f"{dot(place)}type == &{row.c_name}_type"
        return Step(path, place, node, index, condition, f"(*(({row.struct_name} *){dot(place)}value))")
    index = next((k for k, f in enumerate(node.fields) if f.name == name), -1)
    if index < 0:
        raise KeyError(f"{node.c_name} has no {name}")
    f = node.fields[index]
    if node.kind is Kind.CHOICE:
        inside, condition = f"{dot(place)}u.{member(name)}", f"{dot(place)}choice == {index + 1}"
    else:
        inside = f"{dot(place)}{member(name)}"
        is_asked = f.is_optional and (f.default is None or path in flags)
        condition = f"{dot(place)}has_{member(name)}" if is_asked else ""
    return Step(path, place, node, index, condition, f"(*{inside})" if f.is_pointer else inside)


def dot(place: str) -> str:
    """What stands before the name of a member."""
    return f"{place[2:-1]}->" if place.startswith("(*") and "(" not in place[2:] else f"{place}."


def pointer(place: str) -> str:
    """To a value, as an argument."""
    return place[2:-1] if place.startswith("(*") and "(" not in place[2:] else f"&{place}"


def is_struct(node: Node) -> bool:
    return node.kind in STRUCTS
