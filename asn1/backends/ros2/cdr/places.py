"""Place of a ROS field in the C struct: a path through the layout."""

from collections.abc import Set
from typing import NamedTuple

from asn1.backends.c.names import member
from asn1.backends.ros2.model import Path
from asn1.layout.nodes import STRUCTS, Field, Kind, Node


class Step(NamedTuple):
    """One step of a path: to a component, an alternative or a row of an open type.

    path       path including this step
    holder     C expression of the enclosing value
    node       type of the enclosing value
    number     index of the field or row, from 0
    condition  C condition that it is present; "" if it always is
    place      C expression of it
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
    """End of a path: C expression, type, and the steps that lead there."""

    place: str
    node: Node
    steps: tuple[Step, ...]

    @property
    def condition(self) -> str:
        """C condition that the place is present; "" if it always is."""
        return " && ".join(step.condition for step in self.steps if step.condition)


def follow(node: Node, place: str, path: Path, flags: Set[Path] = frozenset()) -> Place:
    """Follow a path from a value. Returns its end.

    flags  paths whose presence a field of the message contains. A component with a DEFAULT counts as optional only if
           its path is one of these.

    Raises KeyError for an unknown name.
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
    """Return the C expression before a member's name: with `.` or `->`."""
    return f"{place[2:-1]}->" if place.startswith("(*") and "(" not in place[2:] else f"{place}."


def pointer(place: str) -> str:
    """Return a pointer to a value as C argument."""
    return place[2:-1] if place.startswith("(*") and "(" not in place[2:] else f"&{place}"


def is_struct(node: Node) -> bool:
    return node.kind in STRUCTS
