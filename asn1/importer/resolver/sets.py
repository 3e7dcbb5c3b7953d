"""Resolver of constraints: converts them to sets of numbers, sizes, characters and inner types."""

from collections.abc import Callable, Set

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import Place, fault
from asn1.importer.resolver.program import MAX_STEPS, Program, Scope, Typed
from asn1.importer.resolver.unsupported import CLAUSES
from asn1.importer.resolver.values import PLAIN_NUMBER, number
from asn1.model import types

_STRINGS = {"IA5String", "UTF8String", "NumericString", "PrintableString", "VisibleString", "ISO646String"}
_SIZED = {*_STRINGS, "OCTET STRING", "BIT STRING", "a list"}
_COUNTED = {"INTEGER", "ENUMERATED", "BOOLEAN"}

TypeResolver = Callable[[syntax.Type, Scope], types.Type]


class Constraints:
    """Resolves the constraints of a type.

    In its methods, `governor` is the constrained type, and `characters` is true inside FROM.
    """

    def __init__(self, program: Program, resolve_type: TypeResolver) -> None:
        self._program = program
        self._resolve_type = resolve_type

    def constraint(
        self, text: syntax.Constraint, scope: Scope, governor: Typed, characters: bool = False
    ) -> types.Constraint:
        root = self._elements(text.root, scope, governor, characters)
        additions = None
        if text.additions is not None:
            additions = self._elements(text.additions, scope, governor, characters)
        return types.Constraint(root, text.is_extensible, additions)

    def _elements(self, text: syntax.Elements, scope: Scope, governor: Typed, characters: bool) -> types.ElementSet:
        match text:
            case syntax.Single() | syntax.Between():
                self._refuse_others(governor, {*_COUNTED, *_STRINGS} if characters else _COUNTED, text)
                return types.Values(self._ranges(text, scope, governor, characters))
            case syntax.SizeOf():
                self._refuse_others(governor, _SIZED, text)
                return types.Size(self.constraint(text.constraint, scope, PLAIN_NUMBER))
            case syntax.From():
                self._refuse_others(governor, _STRINGS, text)
                return types.Alphabet(self.constraint(text.constraint, scope, governor, characters=True))
            case syntax.With():
                return types.Element(self.constraint(text.constraint, scope, self._element(text, governor)))
            case syntax.WithAll():
                return self._inner(text, scope, governor)
            case syntax.Containing():
                self._refuse_others(governor, {"OCTET STRING", "BIT STRING"}, text)
                return types.Contents(self._resolve_type(text.type, scope))
            case syntax.Included():
                with self._program.step(text.place):
                    return self._included(text, scope)
            case syntax.Union():
                return _union([self._elements(member, scope, governor, characters) for member in text.members])
            case syntax.Intersection():
                return types.AllOf(
                    tuple(self._elements(member, scope, governor, characters) for member in text.members)
                )
            case syntax.Except():
                without = types.AllExcept(self._elements(text.without, scope, governor, characters))
                if text.base is None:
                    return without
                return types.AllOf((self._elements(text.base, scope, governor, characters), without))

    def _refuse_others(self, governor: Typed, names: Set[str], text: syntax.Elements) -> None:
        """Raise ImportFault if this constraint does not apply to the type (X.680 51.1, table 9)."""
        name = _name(self._program.base(governor).type)
        if name not in names and name not in CLAUSES:  # types of CLAUSES are unsupported; another check reports them
            raise fault(_place(text), f"this constraint cannot be on {name}", "X.680 51.1")

    def _ranges(
        self, text: syntax.Single | syntax.Between, scope: Scope, governor: Typed, characters: bool
    ) -> tuple[types.Range, ...]:
        if isinstance(text, syntax.Single) and characters and isinstance(text.value, syntax.Text):
            if not text.value.value:
                raise fault(text.value.place, "invalid: alphabet without characters", "X.680 51.7")
            return merged([types.Range(ord(one), ord(one)) for one in text.value.value])
        if isinstance(text, syntax.Single):
            value = self._end(text.value, scope, governor, characters)
            if value is None:
                raise fault(text.value.place, "unsupported: MIN or MAX alone", "X.680 51.4")
            return (types.Range(value, value),)
        low = self._end(text.low, scope, governor, characters)
        high = self._end(text.high, scope, governor, characters)
        if low is not None and text.excludes_low:
            low += 1
        if high is not None and text.excludes_high:
            high -= 1
        if low is not None and high is not None and low > high:
            raise fault(text.low.place, f"the range {low}..{high} is empty", "X.680 51.4")
        return (types.Range(low, high),)

    def _end(self, value: syntax.Value, scope: Scope, governor: Typed, characters: bool) -> int | None:
        """Return one end of a range; None for MIN or MAX."""
        if isinstance(value, syntax.Word) and value.name in {"MIN", "MAX"}:
            return None
        if characters and isinstance(value, syntax.Text) and len(value.value) == 1:
            return ord(value.value)
        if isinstance(value, syntax.Text | syntax.Bits | syntax.Octets | syntax.Braces):
            raise fault(value.place, "unsupported: constraint with values that are not numbers", "X.680 51.2")
        return number(self._program, value, scope, governor)

    def _element(self, text: syntax.With, governor: Typed) -> Typed:
        base = self._program.base(governor)
        if not isinstance(base.type, syntax.ListOf):
            raise fault(text.place, "invalid: WITH COMPONENT of a type that is not a list", "X.680 51.8.3")
        return Typed(base.type.element, base.scope)

    def _inner(self, text: syntax.WithAll, scope: Scope, governor: Typed) -> types.Inner:
        base = self._program.base(governor)
        if not isinstance(base.type, syntax.Structure):
            raise fault(text.place, "invalid: WITH COMPONENTS of a type without components", "X.680 51.8.4")
        members = {one.component.name: one for one in self._program.all_members(base)}
        lines: list[types.InnerComponent] = []
        for line in text.lines:
            if line.name not in members:
                raise fault(line.place, f"unknown component {line.name}", "X.680 51.8.5")
            member = members[line.name]
            constraint = None
            if line.constraint is not None:
                constraint = self.constraint(line.constraint, scope, Typed(member.component.type, member.scope))
            lines.append(types.InnerComponent(line.name, constraint, line.presence))
        return types.Inner(text.partial, tuple(lines))

    def _included(self, text: syntax.Included, scope: Scope) -> types.ElementSet:
        """Return the constraints of an included type as their intersection, without their extensions (X.680 51.3.3)."""
        typed = Typed(text.type, scope)
        found: list[types.ElementSet] = []
        for _ in range(MAX_STEPS):
            constraints = typed.type.constraints
            found[:0] = [self.constraint(one, typed.scope, typed).root for one in constraints]
            if not isinstance(typed.type, syntax.Reference):
                break
            typed = self._program.target(typed.type, typed.scope)
        if not found:
            raise fault(text.place, "the type included here has no constraint", "X.680 51.3")
        return found[0] if len(found) == 1 else types.AllOf(tuple(found))


def _name(type_: syntax.Type) -> str:
    match type_:
        case syntax.Plain(name=name) | syntax.WithItems(name=name) | syntax.Structure(name=name):
            return name
        case syntax.Enumerated():
            return "ENUMERATED"
        case syntax.ListOf():
            return "a list"
    return "an open type"


def _place(text: syntax.Elements) -> Place:
    match text:
        case syntax.Single():
            return text.value.place
        case syntax.Between():
            return text.low.place
        case syntax.SizeOf() | syntax.From() | syntax.Containing():
            return text.place
    raise AssertionError(text)


def _union(members: list[types.ElementSet]) -> types.ElementSet:
    numbers = [member for member in members if isinstance(member, types.Values)]
    if len(numbers) == len(members):
        return types.Values(merged([one for member in numbers for one in member.ranges]))
    return types.AnyOf(tuple(members))


def merged(ranges: list[types.Range]) -> tuple[types.Range, ...]:
    """Return the same numbers as ascending ranges that do not touch each other."""
    found: list[types.Range] = []
    for one in sorted(ranges, key=lambda one: (one.low is not None, one.low or 0)):
        last = found[-1] if found else None
        if last is not None and (last.high is None or one.low is None or one.low <= last.high + 1):
            high = None if last.high is None or one.high is None else max(last.high, one.high)
            found[-1] = types.Range(last.low, high)
        else:
            found.append(one)
    return tuple(found)
