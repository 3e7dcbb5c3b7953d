"""All modules of an import together: what a name means where it stands."""

import dataclasses
import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

from asn1.importer import syntax
from asn1.importer.fault import Place, fault

# References one behind the other, values in values, imports of imports: no standard needs ten.
MAX_STEPS = 50
_VERSION = re.compile(r"\bv\d+(\.\d+)*")


@dataclass(frozen=True, slots=True)
class Source:
    """A module with its key, and the keys of the modules it imports from, by their names.

    standard  its document, or "" for a file that is of none
    left_out  names of its text that the schema has not kept
    """

    key: str
    module: syntax.Module
    imports: Mapping[str, str]
    standard: str = ""
    left_out: frozenset[str] = frozenset()

    def lacks(self, name: str) -> str:
        """Return an error: unknown name, and similar ones: "ETSI-ITS-CDD v2.1.1 has no ActionID; ActionId?"."""
        told = f"{self._title()} has no {name}{_alike(name, self.module.assignments)}"
        if name not in self.left_out:
            return told
        remedy = f"opy the definition of {name} from the standard into your file"
        return f"{told} Or c{remedy}" if told.endswith("?") else f"{told}; c{remedy}"

    def _title(self) -> str:
        version = _VERSION.search(self.standard)
        return (
            f"{self.module.name} {version[0]}"
            if version
            else f"{self.module.name} of {self.standard or self.module.place.file}"
        )


class Bound(NamedTuple):
    """An actual parameter, and where its text stands."""

    actual: syntax.Actual
    scope: "Scope"


@dataclass(frozen=True, slots=True)
class Scope:
    """Where a text stands: in which module, and with which actual parameters for the formal ones."""

    key: str
    bound: Mapping[str, Bound] = field(default_factory=dict)


class Typed(NamedTuple):
    """A type as written, and where."""

    type: syntax.Type
    scope: Scope


class Member(NamedTuple):
    """A component or alternative, COMPONENTS OF expanded, and where it stands."""

    component: syntax.Component
    scope: Scope


class Program:
    """Looks names up. Every method raises ImportFault with the place where the name stands."""

    def __init__(self, sources: Mapping[str, Source]) -> None:
        self.sources = sources
        self._depth = 0

    @contextmanager
    def step(self, place: Place) -> Iterator[None]:
        """Around everything that may lead back to itself: raises where it does."""
        self._depth += 1
        try:
            if self._depth > MAX_STEPS:
                raise fault(place, "this leads back to itself")
            yield
        finally:
            self._depth -= 1

    def find(self, scope: Scope, name: str, place: Place, module: str | None = None) -> tuple[str, syntax.Assignment]:
        """The assignment that a name means, and the key of its module. module: of Module.Name."""
        key = scope.key
        for _ in range(MAX_STEPS):
            source = self.sources[key]
            if module in {None, source.module.name} and name in source.module.assignments:
                return key, source.module.assignments[name]
            if module is None:
                imported = source.module.imports.get(name)
                if imported is None and key != scope.key:
                    raise fault(place, source.lacks(name))
                if imported is None:
                    break
                module, place = imported.module, imported.place
            if module not in source.imports:
                raise fault(place, f"no module {module} to import {name} from")
            key, module = source.imports[module], None
        raise fault(place, f"{name} is neither defined nor imported")

    def actual(self, actual: syntax.Actual, scope: Scope) -> Bound:
        """What an actual parameter stands for: where it is a formal one of the template around it, that one's.

        Its text gets the actual parameters around it put in, so that it names the instance.
        """
        name = actual.set_
        match actual.type, actual.value:
            case syntax.Reference(module=None, actuals=None, constraints=()) as reference, _:
                name = reference.name
            case _, syntax.Word(module=None) as word:
                name = word.name
        closed = " ".join(
            scope.bound[word].actual.text if word in scope.bound else word for word in actual.text.split()
        )
        return scope.bound.get(name or "", Bound(dataclasses.replace(actual, text=closed), scope))

    def instance(self, reference: syntax.Reference, scope: Scope, assignment: syntax.Assignment, key: str) -> Scope:
        """The scope inside the template that a reference with actual parameters names."""
        actuals = reference.actuals or ()
        if len(actuals) != len(assignment.formals):
            text = f"{assignment.name} takes {len(assignment.formals)} parameters, {len(actuals)} are given"
            raise fault(reference.place, text, "X.683 9.6")
        bound = (self.actual(actual, scope) for actual in actuals)
        return Scope(key, {formal.name: one for formal, one in zip(assignment.formals, bound, strict=True)})

    def target(self, reference: syntax.Reference, scope: Scope) -> Typed:
        """What a reference names: one step."""
        if reference.module is None and reference.name in scope.bound:
            bound = scope.bound[reference.name]
            if bound.actual.type is None:
                raise fault(reference.place, f"the parameter {reference.name} is no type", "X.683 9.5")
            return Typed(bound.actual.type, bound.scope)
        key, assignment = self.find(scope, reference.name, reference.place, reference.module)
        if not isinstance(assignment, syntax.TypeAssignment):
            raise fault(reference.place, f"{reference.name} is no type")
        return Typed(assignment.type, self.instance(reference, scope, assignment, key))

    def base(self, typed: Typed) -> Typed:
        """The builtin type behind any number of references; a fixed-type field of a class is its type."""
        for _ in range(MAX_STEPS):
            match typed.type:
                case syntax.Reference() as reference:
                    typed = self.target(reference, typed.scope)
                case syntax.FieldOf() as field_of:
                    key, class_ = self.class_(field_of, typed.scope)
                    type_ = self.field(field_of, class_).type
                    if type_ is None:
                        return typed
                    typed = Typed(type_, Scope(key))
                case _:
                    return typed
        raise fault(typed.type.place, "a type that is only itself", "X.680 3.8.41")

    def class_(self, field_of: syntax.FieldOf, scope: Scope) -> tuple[str, syntax.ClassAssignment]:
        key, assignment = self.find(scope, field_of.class_, field_of.place)
        if not isinstance(assignment, syntax.ClassAssignment):
            raise fault(field_of.place, f"{field_of.class_} is no class", "X.681 9")
        return key, assignment

    @staticmethod
    def field(field_of: syntax.FieldOf, class_: syntax.ClassAssignment) -> syntax.ClassField:
        for one in class_.fields:
            if one.name == field_of.field:
                return one
        raise fault(field_of.place, f"{class_.name} has no field {field_of.field}", "X.681 14")

    def members(self, components: tuple[syntax.Member, ...], scope: Scope) -> Iterator[Member]:
        """Components in the order of the text, those of groups among them, COMPONENTS OF expanded (X.680 25.5)."""
        for one in components:
            match one:
                case syntax.Component():
                    yield Member(one, scope)
                case syntax.Group():
                    yield from self.members(one.components, scope)
                case syntax.ComponentsOf():
                    with self.step(one.place):
                        yield from self._components_of(one, scope)

    def _components_of(self, one: syntax.ComponentsOf, scope: Scope) -> Iterator[Member]:
        base, inside = self.base(Typed(one.type, scope))
        if not isinstance(base, syntax.Structure) or base.name == "CHOICE":
            raise fault(one.place, "COMPONENTS OF what is no SEQUENCE", "X.680 25.5")
        yield from self.members((*base.members.root, *base.members.tail), inside)

    def all_members(self, typed: Typed) -> Iterator[Member]:
        """Of a SEQUENCE, SET or CHOICE: root, additions and tail."""
        assert isinstance(typed.type, syntax.Structure)
        members = typed.type.members
        yield from self.members((*members.root, *members.additions, *members.tail), typed.scope)


def instance_name(template: str, scope: Scope) -> str:
    """<template>-<actual parameters>, as a name of ASN.1."""
    words = [re.sub(r"[^A-Za-z0-9]+", "-", bound.actual.text).strip("-") for bound in scope.bound.values()]
    return "-".join([template, *words])


def _alike(name: str, names: Iterable[str]) -> str:
    """Return similar names, as a question: "; ActionId?"."""
    known = list(names)
    same = [one for one in known if one.lower() == name.lower()]
    alike = same or difflib.get_close_matches(name, known, n=3)
    return f"; {' or '.join(alike)}?" if alike else ""
