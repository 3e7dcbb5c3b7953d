"""Conditions in C for constraints that PER ignores: WITH COMPONENTS, WITH COMPONENT.

X.680 51.8: a full specification (without an ellipsis) requires every component that it
names to be present, and all others to be absent. A partial one requires neither.
"""

from collections.abc import Iterable

from asn1.backends.c.names import literal, member
from asn1.layout.nodes import Field, Kind, Node
from asn1.model.types import (
    AllExcept,
    AllOf,
    AnyOf,
    Constraint,
    Element,
    ElementSet,
    Inner,
    InnerComponent,
    Size,
    Values,
)


class Predicates:
    """C conditions for constraints, and the functions that they call."""

    def __init__(self) -> None:
        self.functions: list[str] = []
        self.count = 0
        self.free: dict[Node, bool] = {}

    def inner(self, constraint: Constraint, node: Node, of: str) -> str | None:
        """Return the condition of a constraint, as far as the effective bounds do not cover it; None without one."""
        if not is_inner(constraint.root) and node.kind is not Kind.ENUMERATED:
            return None
        return self.constraint(constraint, node, of)

    def constraint(self, constraint: Constraint, node: Node, of: str) -> str | None:
        return None if constraint.is_extensible else self.elements(constraint.root, node, of)

    def elements(self, elements: ElementSet, node: Node, of: str) -> str | None:
        """Return the condition of a set; None if it is always true."""
        match elements:
            case Values():
                return _values(elements, node, of)
            case Size():
                return None if elements.within.is_extensible else _size(elements.within.root, node, of)
            case Inner():
                return _join(" && ", self.components(elements, node, of))
            case Element():
                return self.every(elements.constraint, node, of)
            case AllOf():
                return _join(" && ", (self.elements(part, node, of) for part in elements.members))
            case AnyOf():
                parts = [self.elements(part, node, of) for part in elements.members]
                return None if None in parts else _join(" || ", parts)
            case AllExcept():
                part = self.elements(elements.member, node, of)
                return None if part is None else f"!({part})"
            case _:
                return None

    def components(self, inner: Inner, node: Node, of: str) -> Iterable[str | None]:
        named = {component.name for component in inner.components}
        for number, f in enumerate(node.fields, 1):
            there = _there(node, number, f, of)
            if f.name not in named and not inner.partial and there is not None:
                yield f"!({there})"
        for component in inner.components:
            for number, f in enumerate(node.fields, 1):
                if f.name == component.name:
                    yield from self.component(inner, component, node, number, f, of)

    def component(
        self, inner: Inner, component: InnerComponent, node: Node, number: int, f: Field, of: str
    ) -> Iterable[str | None]:
        there = _there(node, number, f, of)
        implied = None if inner.partial or node.kind is Kind.CHOICE else "PRESENT"
        presence = component.presence or implied
        if there is not None and presence in ("PRESENT", "ABSENT"):
            yield there if presence == "PRESENT" else f"!({there})"
        if component.constraint is None or presence == "ABSENT":
            return
        place = f"{of}.u.{member(f.name)}" if node.kind is Kind.CHOICE else f"{of}.{member(f.name)}"
        condition = self.constraint(component.constraint, f.node, f"(*{place})" if f.is_pointer else place)
        if condition is not None:
            yield condition if there is None else f"(!({there}) || ({condition}))"

    def every(self, constraint: Constraint, node: Node, of: str) -> str | None:
        """Return a condition for all elements of a list; it calls a function that is added to `functions`."""
        condition = self.constraint(constraint, node.item, "v->items[i]")
        if condition is None:
            return None
        self.count += 1
        name = f"{node.c_name}_every_{self.count}"
        self.functions += [
            f"static bool {name}(const {node.struct_name} *v)",
            "{",
            "    for (uint32_t i = 0; i < v->count; i++)",
            f"        if (!({condition}))",
            "            return false;",
            "    return true;",
            "}",
            "",
        ]
        return f"{name}(&{of})"


def is_inner(elements: ElementSet) -> bool:
    match elements:
        case Inner() | Element():
            return True
        case AnyOf() | AllOf():
            return any(is_inner(part) for part in elements.members)
        case AllExcept():
            return is_inner(elements.member)
        case _:
            return False


def _there(node: Node, number: int, f: Field, of: str) -> str | None:
    """Return the condition that a component is present; None if it always is."""
    if node.kind is Kind.CHOICE:
        return f"{of}.choice == {number}"
    return f"{of}.has_{member(f.name)}" if f.is_optional else None


def _values(values: Values, node: Node, of: str) -> str | None:
    if node.kind not in (Kind.INTEGER, Kind.ENUMERATED, Kind.BOOLEAN):
        return None
    number = f"(int64_t){of}"
    parts = []
    for low, high in values.ranges:
        if low is not None and low == high:
            parts.append(f"{number} == {literal(low)}")
        else:
            ends = ([f"{number} >= {literal(low)}"] if low is not None else []) + (
                [f"{number} <= {literal(high)}"] if high is not None else []
            )
            parts.append(_join(" && ", ends) or "true")
    return _join(" || ", parts) or "false"


def _size(elements: ElementSet, node: Node, of: str) -> str | None:
    if not isinstance(elements, Values) or node.kind in (Kind.FIXED_OCTETS, Kind.SMALL_BITS):
        return None
    count = f"captain_text_count(&{of})" if node.kind is Kind.UTF8 else f"{of}.count"
    parts = []
    for low, high in elements.ranges:
        ends = ([f"{count} >= {low}"] if low else []) + ([f"{count} <= {high}"] if high is not None else [])
        parts.append(_join(" && ", ends) or "true")
    return None if "true" in parts else _join(" || ", parts)


def _join(word: str, parts: Iterable[str | None]) -> str | None:
    found = [part for part in parts if part is not None]
    if len(found) < 2:
        return found[0] if found else None
    return word.join(f"({part})" for part in found)
