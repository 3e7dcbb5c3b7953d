"""Resolver: makes the schema of all definitions that the messages reach.

It skips the other definitions, so that an unsupported construct stops only the messages that use it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple, TypeVar

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import ImportFault, Place, Problem, fault
from asn1.importer.resolver import values
from asn1.importer.resolver.objects import Objects
from asn1.importer.resolver.program import Bound, Program, Scope, Source, Typed, instance_name
from asn1.importer.resolver.sets import Constraints
from asn1.importer.resolver.tags import canonical
from asn1.importer.resolver.units import Units
from asn1.importer.resolver.unsupported import CLAUSES, unsupported
from asn1.model import types

_STRINGS = {
    "IA5String": "IA5String",
    "UTF8String": "UTF8String",
    "NumericString": "NumericString",
    "PrintableString": "PrintableString",
    "VisibleString": "VisibleString",
    "ISO646String": "VisibleString",  # ISO646String is another name of VisibleString (X.680 41.1)
}

T = TypeVar("T")

# Limit for names of instances, in characters. The standards' longest has 45; a template that instantiates itself
# would have no limit.
MAX_NAME = 250


class Resolved(NamedTuple):
    """Definitions of one module, in the order of its text."""

    definitions: dict[str, types.Definition]
    classes: dict[str, types.ObjectClass]
    sets: dict[str, types.ObjectSet]


class _Wanted(NamedTuple):
    """A definition to resolve; for a template, the instance with this scope."""

    assignment: syntax.Assignment
    scope: Scope
    actuals: tuple[object, ...] = ()


class Resolver:
    """Resolves the requested definitions and all that they refer to."""

    def __init__(self, sources: Mapping[str, Source], units: Units) -> None:
        self._program = Program(sources)
        self._constraints = Constraints(self._program, self._type)
        self._objects = Objects(self._program, self._type)
        self._units = units
        self._wanted: dict[tuple[str, str], _Wanted] = {}
        self._open: list[tuple[str, str]] = []
        self._problems: list[Problem] = []
        self._done: dict[tuple[str, str], types.Definition | types.ObjectClass | types.ObjectSet] = {}

    def resolve(self, roots: Iterable[tuple[str, str, Place]]) -> dict[str, Resolved]:
        """Resolve the roots and all that they reach. Returns the results by key of the module.

        roots  key of the module, name of the type, and place for errors.

        Raises ImportFault with all problems found.
        """
        for key, name, place in roots:
            with self._noted():
                self._reach(Scope(key), name, place)
        while self._open:
            key, name = self._open.pop()
            with self._noted():
                self._define(key, name)
        if self._problems:
            raise ImportFault(self._problems)
        return self._in_order()

    @contextmanager
    def _noted(self) -> Iterator[None]:
        """Collect the problems of one definition, so that the others are still checked."""
        try:
            yield
        except ImportFault as error:
            self._problems += error.problems

    def _reach(self, scope: Scope, name: str, place: Place, module: str | None = None) -> types.Reference:
        key, assignment = self._program.find(scope, name, place, module)
        if assignment.formals:
            raise fault(place, f"{name} needs parameters", "X.683 9")
        return self._want(key, name, _Wanted(assignment, Scope(key)))

    def _want(self, key: str, name: str, wanted: _Wanted) -> types.Reference:
        known = self._wanted.get((key, name))
        if known is None:
            self._wanted[key, name] = wanted
            self._open.append((key, name))
        elif known.assignment is not wanted.assignment or known.actuals != wanted.actuals:
            raise fault(wanted.assignment.place, f"two definitions would have the same name, {name}")
        return types.Reference(module=key, name=name)

    def _define(self, key: str, name: str) -> None:
        assignment, scope, _ = self._wanted[key, name]
        match assignment:
            case syntax.TypeAssignment():
                # raises ImportFault for a type that is defined as itself
                self._program.base(Typed(assignment.type, scope))
                unit = self._units.normal(assignment.unit)
                type_ = _closed(self._type(assignment.type, scope), assignment.place)
                self._done[key, name] = types.Definition(name, type_, unit)
            case syntax.ClassAssignment():
                self._done[key, name] = self._objects.class_(key, assignment)
            case syntax.SetAssignment():
                self._done[key, name] = self._objects.set_(key, assignment)
            case _:
                raise fault(assignment.place, f"{name} is not a type")

    def _in_order(self) -> dict[str, Resolved]:
        """Return the results by key.

        Definitions keep the order of the text; instances follow at their template, by name.
        """
        found: dict[str, Resolved] = {}
        for key, source in self._program.sources.items():
            resolved = Resolved({}, {}, {})
            place = {id(one): at for at, one in enumerate(source.module.assignments.values())}
            names = [name for of, name in self._done if of == key]
            for name in sorted(names, key=lambda name: (place[id(self._wanted[key, name].assignment)], name)):
                match self._done[key, name]:
                    case types.Definition() as definition:
                        resolved.definitions[name] = definition
                    case types.ObjectClass() as class_:
                        resolved.classes[name] = class_
                    case types.ObjectSet() as set_:
                        resolved.sets[name] = set_
            if names:
                found[key] = resolved
        return found

    # ------------------------------------------------------------ types

    def _type(self, text: syntax.Type, scope: Scope) -> types.Type:
        governor = Typed(text, scope)
        if isinstance(text, syntax.Plain | syntax.Structure) and text.name in CLAUSES:
            raise unsupported(text.place, text.name)
        constraints = tuple(self._constraints.constraint(one, scope, governor) for one in text.constraints)
        match text:
            case syntax.Plain():
                return _plain(text, constraints)
            case syntax.WithItems(name="INTEGER"):
                return types.Integer(constraints=constraints, names=values.names(self._program, governor))
            case syntax.WithItems():
                return types.BitString(constraints=constraints, names=values.names(self._program, governor))
            case syntax.Enumerated():
                root = values.root_items(self._program, governor)
                additions = values.addition_items(self._program, governor)
                return types.Enumerated(root, text.is_extensible, additions, constraints=constraints)
            case syntax.Structure():
                return self._structure(text, scope, constraints)
            case syntax.ListOf():
                element = _closed(self._type(text.element, scope), text.place)
                return types.SequenceOf(element, text.is_set, constraints=constraints)
            case syntax.Reference():
                return self._reference(text, scope, constraints)
            case syntax.FieldOf():
                return self._field(text, scope, constraints)
        raise fault(text.place, "unknown type")  # pragma: no cover

    def _structure(
        self, text: syntax.Structure, scope: Scope, constraints: tuple[types.Constraint, ...]
    ) -> types.Sequence | types.Choice:
        members = text.members
        problems: list[Problem] = []
        root = self._components(members.root, scope, problems)
        tail = self._components(members.tail, scope, problems)
        additions = _each((partial(self._addition, one, scope, problems) for one in members.additions), problems)
        if problems:
            raise ImportFault(problems)
        components = [one for member in (*root, *additions, *tail) for one in _of(member)]
        _distinct(text.place, components)
        flag = members.is_extensible
        if text.name == "SEQUENCE":
            _selected(text.place, (*root, *tail), additions)
            return types.Sequence(root, flag, additions, tail, constraints=constraints)
        if tail:
            raise fault(text.place, "unsupported: alternatives after a second ellipsis", "X.680 29.1")
        for one in components:
            _closed(one.type, text.place)
        order = canonical(self._program, Typed(text, scope))
        by_name = {one.name: one for one in root}
        return types.Choice(tuple(by_name[name] for name in order), flag, additions, constraints=constraints)

    def _components(
        self, members: tuple[syntax.Member, ...], scope: Scope, problems: list[Problem]
    ) -> tuple[types.Component, ...]:
        found = self._program.members(members, scope)
        return _each((partial(self._component, one.component, one.scope) for one in found), problems)

    def _addition(self, member: syntax.Member, scope: Scope, problems: list[Problem]) -> types.Component | types.Group:
        match member:
            case syntax.Component():
                return self._component(member, scope)
            case syntax.Group():
                return types.Group(self._components(member.components, scope, problems), member.version)
        raise fault(member.place, "unsupported: COMPONENTS OF among extension additions", "X.680 25.5")

    def _component(self, text: syntax.Component, scope: Scope) -> types.Component:
        type_ = self._type(text.type, scope)
        default: types.Default = None
        if text.default is not None:
            default = values.default(self._program, text.default, scope, Typed(text.type, scope))
        return types.Component(text.name, type_, text.is_optional, default, self._units.normal(text.unit))

    def _reference(self, text: syntax.Reference, scope: Scope, constraints: tuple[types.Constraint, ...]) -> types.Type:
        if text.module is None and text.name in scope.bound:
            return self._parameter(text, scope, constraints)
        key, assignment = self._program.find(scope, text.name, text.place, text.module)
        if not isinstance(assignment, syntax.TypeAssignment):
            raise fault(text.place, f"{text.name} is not a type")
        inside = self._program.instance(text, scope, assignment, key)
        if not inside.bound:
            found = self._want(key, text.name, _Wanted(assignment, inside))
        else:
            actuals = tuple(_identity(one) for one in inside.bound.values())
            name = instance_name(text.name, inside)
            if len(name) > MAX_NAME:
                raise fault(text.place, f"endless instances of {text.name}", "X.683 9")
            found = self._want(key, name, _Wanted(assignment, inside, actuals))
        return types.Reference(module=found.module, name=found.name, constraints=constraints)

    def _parameter(self, text: syntax.Reference, scope: Scope, constraints: tuple[types.Constraint, ...]) -> types.Type:
        """Resolve a formal parameter as its actual type; the constraints here come after those of the type."""
        target = self._program.target(text, scope)
        found = self._type(target.type, target.scope)
        return types.with_constraints(found, constraints)

    def _field(self, text: syntax.FieldOf, scope: Scope, constraints: tuple[types.Constraint, ...]) -> types.Type:
        key, class_ = self._program.class_(text, scope)
        field = self._program.field(text, class_)
        if text.set_ is None:
            if field.type is None:
                raise fault(text.place, "unsupported: open type without a table constraint", "X.682 10")
            return types.with_constraints(self._type(field.type, Scope(key)), constraints)
        class_reference = self._want(key, class_.name, _Wanted(class_, Scope(key)))
        set_reference = self._set(text, scope)
        if field.type is not None:
            return types.ClassField(class_reference, set_reference, constraints=constraints)
        if text.selector is None:
            raise fault(text.place, "unsupported: open type without a component with its identifier", "X.682 10.7")
        return types.OpenType(class_reference, set_reference, text.selector, constraints=constraints)

    def _set(self, text: syntax.FieldOf, scope: Scope) -> types.Reference:
        name = text.set_
        assert name is not None
        if name in scope.bound:
            bound = scope.bound[name]
            return self._reach(bound.scope, bound.actual.text, bound.actual.place)
        return self._reach(scope, name, text.place)


def _each(calls: Iterable[Callable[[], T]], problems: list[Problem]) -> tuple[T, ...]:
    """Return the results of the calls. Problems of a call are added to `problems`, and its result is omitted."""
    found: list[T] = []
    for call in calls:
        try:
            found.append(call())
        except ImportFault as error:
            problems += error.problems
    return tuple(found)


def _identity(bound: Bound) -> tuple[object, ...]:
    """Return the text of an actual parameter, and the modules in which its names are looked up."""
    return bound.scope.key, bound.actual.text, *(one.scope.key for one in bound.scope.bound.values())


def _plain(text: syntax.Plain, constraints: tuple[types.Constraint, ...]) -> types.Type:
    match text.name:
        case "BOOLEAN":
            return types.Boolean(constraints=constraints)
        case "NULL":
            return types.Null(constraints=constraints)
        case "OCTET STRING":
            return types.OctetString(constraints=constraints)
        case "OBJECT IDENTIFIER" | "RELATIVE-OID":
            return types.ObjectIdentifier(text.name == "RELATIVE-OID", constraints=constraints)
        case name if name in _STRINGS:
            return types.CharacterString(_STRINGS[name], constraints=constraints)
    raise fault(text.place, "unknown type")  # pragma: no cover


def _distinct(place: Place, components: list[types.Component]) -> None:
    names = [one.name for one in components]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise fault(place, f"two components are called {twice[0]}", "X.680 25.11")


def _selected(
    place: Place, root: tuple[types.Component, ...], additions: tuple[types.Component | types.Group, ...]
) -> None:
    """Check each open type: its selector must be of the same object set, always present, and encoded before it."""
    parts = [root, *map(_of, additions)]
    fields = {one.name: one.type for part in parts for one in part}
    before: set[str] = set()
    for part in parts:
        known = set(before)  # the presence of one addition does not imply that of another
        for one in part:
            if isinstance(one.type, types.OpenType):
                beside = fields.get(one.type.selector)
                if not isinstance(beside, types.ClassField) or beside.set_ != one.type.set_:
                    text = f"{one.name}: {one.type.selector} has no field of the same class and object set"
                    raise fault(place, text, "X.682 10.8")
                if one.type.selector not in known:
                    text = f"{one.name}: {one.type.selector}, which selects its type, is OPTIONAL or comes after it"
                    raise fault(place, text, "X.682 10.8")
            if not one.is_optional and one.default is None:
                known.add(one.name)
        before = before if part is not root else known


def _closed(type_: types.Type, place: Place) -> types.Type:
    """Return the type. Raises ImportFault for an open type: it needs a SEQUENCE with a component for its identifier."""
    if isinstance(type_, types.OpenType):
        raise fault(place, "unsupported: open type outside a SEQUENCE", "X.682 10.7")
    return type_


def _of(member: types.Component | types.Group) -> tuple[types.Component, ...]:
    return member.components if isinstance(member, types.Group) else (member,)
