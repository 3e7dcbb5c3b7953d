"""Ranges of constraint chains, computed independently of asn1/model/constraints.py.

Numbers, sizes and code points are unions of ranges; an end that is open is an infinity.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from asn1.model import types as t

Ends = tuple[float, float]  # int or infinity
Union = tuple[Ends, ...]  # ascending, none touching another
TABLE = t.Constraint(t.AllOf(()))  # ({Set}): a constraint that PER does not see, without marker (X.682 10)
EVERYTHING: Union = ((-math.inf, math.inf),)
SIZES: Union = ((0, math.inf),)


class Allowed(NamedTuple):
    """root: what stands before the marker; additions: behind it, empty where nothing is said there."""

    root: Union
    is_extensible: bool = False
    additions: Union = ()

    @property
    def low(self) -> int | None:
        return None if math.isinf(self.root[0][0]) else int(self.root[0][0])

    @property
    def high(self) -> int | None:
        return None if math.isinf(self.root[-1][1]) else int(self.root[-1][1])

    @property
    def has_gaps(self) -> bool:
        return len(self.root) > 1

    def holds(self, number: int) -> bool:
        """In the effective root range: gaps of a union are invisible (X.691 3.7.8)."""
        return self.root[0][0] <= number <= self.root[-1][1]


@dataclass(frozen=True, slots=True)
class Kept(t.Schema):
    """Schema of the -ext form: an extension marker stays through the constraints that follow it."""


def read_as(schema: t.Schema, message: t.Message) -> t.Schema:
    """Return the schema in the form of a message."""
    return Kept(schema.modules, schema.messages) if message.form_of else schema


def unfold(schema: t.Schema, type_: t.Type) -> tuple[t.Type, tuple[t.Constraint, ...]]:
    """The type behind references and class fields, and all constraints, the innermost first."""
    constraints = type_.constraints
    while isinstance(type_, t.Reference | t.ClassField):
        if isinstance(type_, t.Reference):
            type_ = schema.resolve(type_).type
        else:
            type_, constraints = (
                schema.modules[type_.class_.module].classes[type_.class_.name].id_type,
                (TABLE, *constraints),
            )
        constraints = type_.constraints + constraints
    return type_, _marked_last(constraints) if isinstance(schema, Kept) else constraints


def _marked_last(constraints: tuple[t.Constraint, ...]) -> tuple[t.Constraint, ...]:
    """Each narrows the same root in any order, and the last one decides about the marker."""
    return tuple(sorted(constraints, key=has_marker))


def numbers(constraints: Iterable[t.Constraint]) -> Allowed:
    """Of an INTEGER."""
    return _serial(constraints, t.Values, EVERYTHING)


def sizes(constraints: Iterable[t.Constraint]) -> Allowed:
    """Of a string or list."""
    return _serial(constraints, t.Size, SIZES)


def alphabet(constraints: Iterable[t.Constraint]) -> Union | None:
    """Code points, or None where no constraint speaks of them."""
    root = _serial(constraints, t.Alphabet, EVERYTHING).root
    return None if root == EVERYTHING else root


def _serial(constraints: Iterable[t.Constraint], aspect: type, universe: Union) -> Allowed:
    """X.680 50.11: each constraint is applied to its parent without the parent's marker and additions."""
    allowed = Allowed(universe)
    for constraint in constraints:
        one = _of(constraint, aspect)
        root = allowed.root if one is None else _intersection(allowed.root, one.root)
        allowed = Allowed(root) if one is None else Allowed(root, one.is_extensible, one.additions)
    return allowed


def _of(constraint: t.Constraint, aspect: type) -> Allowed | None:
    """None: not visible to PER, or not about this aspect."""
    one = _elements(constraint.root, aspect)
    if one is None or (aspect is t.Alphabet and constraint.is_extensible):  # X.691 30.4, note 2
        return None
    more = _elements(constraint.additions, aspect) if constraint.additions is not None else None
    additions = _union((*one.additions, *(more.root if more is not None else ())))
    return Allowed(one.root, one.is_extensible or constraint.is_extensible, additions)


def _elements(elements: t.ElementSet, aspect: type) -> Allowed | None:
    match elements:
        case t.Values(ranges) if aspect is t.Values:
            return Allowed(_union((_low(one), _high(one)) for one in ranges))
        case t.Size(within) if aspect is t.Size:
            return _of(within, t.Values)
        case t.Alphabet(within) if aspect is t.Alphabet and not within.is_extensible:
            return _of(within, t.Values)
        case t.AllOf(members):
            seen = [one for one in (_elements(member, aspect) for member in members) if one is not None]
            return _all_of(seen) if seen else None
        case t.AnyOf(members):
            parts = [_elements(member, aspect) for member in members]
            known = [one for one in parts if one is not None]
            # X.691 10.3.21: a union with a part that is not visible is not visible.
            return Allowed(_union(end for one in known for end in one.root)) if len(known) == len(parts) else None
    return None


def _all_of(parts: list[Allowed]) -> Allowed:
    root = parts[0].root
    for part in parts[1:]:
        root = _intersection(root, part.root)
    return Allowed(root, any(part.is_extensible for part in parts))


def has_marker(constraint: t.Constraint) -> bool:
    """Its own or that of a SIZE in it (X.680 50.4, 50.5)."""
    return constraint.is_extensible or _set_has_marker(constraint.root)


def _set_has_marker(elements: t.ElementSet) -> bool:
    match elements:
        case t.Size(within):
            return within.is_extensible
        case t.AnyOf(members) | t.AllOf(members):
            return any(map(_set_has_marker, members))
    return False


def _union(ranges: Iterable[Ends]) -> Union:
    joined: list[Ends] = []
    for low, high in sorted(ranges):
        if joined and low <= joined[-1][1] + 1:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return tuple(joined)


def _intersection(left: Union, right: Union) -> Union:
    both = ((max(a[0], b[0]), min(a[1], b[1])) for a in left for b in right)
    return _union((low, high) for low, high in both if low <= high)


def _low(one: t.Range) -> float:
    return -math.inf if one.low is None else one.low


def _high(one: t.Range) -> float:
    return math.inf if one.high is None else one.high
