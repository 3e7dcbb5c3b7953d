"""Validator of values against every constraint of X.680, clauses 49 to 51.

Written a second time for the tests, straight over the schema; it shares nothing with the library's validators. What an
extension marker lets through is allowed: it is of a later edition.
"""

from typing import Any

from asn1.model import types as t
from tests.asn1.ranges import has_marker, unfold
from tests.asn1.reach import components


class Validity:
    def __init__(self, schema: t.Schema) -> None:
        self._schema = schema

    def is_valid(self, type_: t.Type, value: Any) -> bool:
        base, constraints = unfold(self._schema, type_)
        return self._keeps(base, constraints, value) and self._inside(base, value)

    def _inside(self, type_: t.Type, value: Any) -> bool:
        match type_:
            case t.SequenceOf():
                return all(self.is_valid(type_.element, one) for one in value)
            case t.Choice():
                chosen = next((one.type for one in components(type_) if one.name == value[0]), None)
                return chosen is None or self.is_valid(chosen, value[1])
            case t.Sequence():
                held = ((one.type, value[one.name]) for one in components(type_) if one.name in value)
                return all(self._is_held_valid(held_type, one, value) for held_type, one in held)
        return True

    def _is_held_valid(self, type_: t.Type, value: Any, holder: dict[str, Any]) -> bool:
        if not isinstance(type_, t.OpenType):
            return self.is_valid(type_, value)
        rows = self._schema.modules[type_.set_.module].sets[type_.set_.name].rows
        row = next((row.type for row in rows if row.value == holder[type_.selector]), None)
        return row is None or self.is_valid(row, value)

    def _keeps(self, type_: t.Type, constraints: tuple[t.Constraint, ...], value: Any) -> bool:
        """X.680 50.11: what follows a marker without one of its own is applied to the root alone."""
        last = max((i for i, one in enumerate(constraints) if not has_marker(one)), default=-1)
        return all(self._elements(type_, one.root, value, True) for one in constraints[: last + 1])

    def _constraint(self, type_: t.Type, constraint: t.Constraint, value: Any) -> bool:
        """Of a component or element: also what its own type says."""
        return has_marker(constraint) or self._elements(type_, constraint.root, value, False)

    def _elements(self, type_: t.Type, elements: t.ElementSet, value: Any, is_root: bool) -> bool:
        match elements:
            case t.Values(ranges):
                return _within(ranges, value)
            case t.Size(within):
                count = value[1] if isinstance(type_, t.BitString) else len(value)
                return (within.is_extensible and not is_root) or _numbers(within, count)
            case t.Alphabet(within):
                return within.is_extensible or all(_numbers(within, ord(one)) for one in value)
            case t.AnyOf(members):
                return any(self._elements(type_, one, value, is_root) for one in members)
            case t.AllOf(members):
                return all(self._elements(type_, one, value, is_root) for one in members)
            case t.AllExcept(member):
                return not self._elements(type_, member, value, is_root)
            case t.Element(constraint) if isinstance(type_, t.SequenceOf):
                base, _ = unfold(self._schema, type_.element)
                return all(self._constraint(base, constraint, one) for one in value)
            case t.Inner():
                return self._inner(type_, elements, value)
        return True

    def _inner(self, type_: t.Type, inner: t.Inner, value: Any) -> bool:
        """51.8: of a CHOICE what is chosen is what is present."""
        assert isinstance(type_, t.Sequence | t.Choice)
        held = dict([value]) if isinstance(type_, t.Choice) else value
        named = {one.name: one for one in inner.components}
        for component in components(type_):
            line = named.get(component.name)
            is_there = component.name in held
            if line is None:
                if is_there and not inner.partial:
                    return False
                continue
            # 51.8.10.3: in a full specification a line without a word means PRESENT, but for a CHOICE.
            word = line.presence or ("PRESENT" if not inner.partial and isinstance(type_, t.Sequence) else None)
            if (word == "PRESENT" and not is_there) or (word == "ABSENT" and is_there):
                return False
            if is_there and line.constraint is not None:
                base, _ = unfold(self._schema, component.type)
                if not self._constraint(base, line.constraint, held[component.name]):
                    return False
        return True


def _within(ranges: tuple[t.Range, ...], number: int) -> bool:
    return any((one.low is None or one.low <= number) and (one.high is None or number <= one.high) for one in ranges)


def _numbers(constraint: t.Constraint, number: int) -> bool:
    match constraint.root:
        case t.Values(ranges):
            return _within(ranges, number)
    raise TypeError(constraint)
