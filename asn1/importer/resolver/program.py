"""Modules of an import: finds the definition of a name in its scope."""

import dataclasses
import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import Place, fault

# Limit for chains of references, values and imports. The standards need fewer than ten.
MAX_STEPS = 50
_VERSION = re.compile(r"\bv\d+(\.\d+)*")


@dataclass(frozen=True, slots=True)
class Source:
    """A module with its key.

    imports   keys of the modules that it imports from, by their names
    standard  its document; "" for a file that is not of a standard
    left_out  names of definitions in its text that the schema omits
    """

    key: str
    module: syntax.Module
    imports: Mapping[str, str]
    standard: str = ""
    left_out: frozenset[str] = frozenset()

    def lacks(self, name: str) -> str:
        """Return an error for an unknown name, with similar ones: "ETSI-ITS-CDD v2.1.1 has no ActionID; ActionId?"."""
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
    """An actual parameter, with the scope of its text."""

    actual: syntax.Actual
    scope: "Scope"


@dataclass(frozen=True, slots=True)
class Scope:
    """Context in which names are looked up: module and, inside a template, its actual parameters by formal names."""

    key: str
    bound: Mapping[str, Bound] = field(default_factory=dict)


class Typed(NamedTuple):
    """A type as written, with its scope."""

    type: syntax.Type
    scope: Scope


class Member(NamedTuple):
    """A component or alternative with its scope; COMPONENTS OF is already expanded."""

    component: syntax.Component
    scope: Scope


class Program:
    """Looks up names. Every method raises ImportFault with the place of the name."""

    def __init__(self, sources: Mapping[str, Source]) -> None:
        self.sources = sources
        self._depth = 0

    @contextmanager
    def step(self, place: Place) -> Iterator[None]:
        """Count the nested steps of a possibly circular lookup. Raises ImportFault beyond MAX_STEPS steps."""
        self._depth += 1
        try:
            if self._depth > MAX_STEPS:
                raise fault(place, "circular definition")
            yield
        finally:
            self._depth -= 1

    def find(self, scope: Scope, name: str, place: Place, module: str | None = None) -> tuple[str, syntax.Assignment]:
        """Return the assignment that a name refers to, and the key of its module.

        module  module in a reference Module.Name; None without one.

        Raises ImportFault if no module defines or imports the name.
        """
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
        """Resolve an actual parameter. If it is itself a formal parameter of the enclosing template, return that one's
        actual.

        Formal parameters in its text are replaced by their actual texts, because the text names the instance.
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
        """Return the scope inside the template that a reference with actual parameters names.

        Raises ImportFault if their number differs from that of the formal ones (X.683 9.6).
        """
        actuals = reference.actuals or ()
        if len(actuals) != len(assignment.formals):
            text = f"{assignment.name} has {len(assignment.formals)} parameters; the reference gives {len(actuals)}"
            raise fault(reference.place, text, "X.683 9.6")
        bound = (self.actual(actual, scope) for actual in actuals)
        return Scope(key, {formal.name: one for formal, one in zip(assignment.formals, bound, strict=True)})

    def target(self, reference: syntax.Reference, scope: Scope) -> Typed:
        """Follow a reference by one step.

        Raises ImportFault if its name, or the parameter bound to it, is not a type.
        """
        if reference.module is None and reference.name in scope.bound:
            bound = scope.bound[reference.name]
            if bound.actual.type is None:
                raise fault(reference.place, f"the parameter {reference.name} is not a type", "X.683 9.5")
            return Typed(bound.actual.type, bound.scope)
        key, assignment = self.find(scope, reference.name, reference.place, reference.module)
        if not isinstance(assignment, syntax.TypeAssignment):
            raise fault(reference.place, f"{reference.name} is not a type")
        return Typed(assignment.type, self.instance(reference, scope, assignment, key))

    def base(self, typed: Typed) -> Typed:
        """Follow all references to the builtin type. A fixed-type field of a class counts as its type.

        Raises ImportFault for a type that is defined as itself.
        """
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
        raise fault(typed.type.place, "invalid: a type that is defined as itself", "X.680 3.8.41")

    def class_(self, field_of: syntax.FieldOf, scope: Scope) -> tuple[str, syntax.ClassAssignment]:
        """Return the class of a field and the key of its module.

        Raises ImportFault if the name is not a class (X.681 9).
        """
        key, assignment = self.find(scope, field_of.class_, field_of.place)
        if not isinstance(assignment, syntax.ClassAssignment):
            raise fault(field_of.place, f"{field_of.class_} is not a class", "X.681 9")
        return key, assignment

    @staticmethod
    def field(field_of: syntax.FieldOf, class_: syntax.ClassAssignment) -> syntax.ClassField:
        """Return a field of a class. Raises ImportFault if it has none of this name (X.681 14)."""
        for one in class_.fields:
            if one.name == field_of.field:
                return one
        raise fault(field_of.place, f"{class_.name} has no field {field_of.field}", "X.681 14")

    def members(self, components: tuple[syntax.Member, ...], scope: Scope) -> Iterator[Member]:
        """Yield components in the order of the text; groups and COMPONENTS OF are expanded (X.680 25.5).

        Raises ImportFault for COMPONENTS OF another type than a SEQUENCE or SET.
        """
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
            raise fault(one.place, "invalid: COMPONENTS OF a type that is not a SEQUENCE", "X.680 25.5")
        yield from self.members((*base.members.root, *base.members.tail), inside)

    def all_members(self, typed: Typed) -> Iterator[Member]:
        """Yield all members of a SEQUENCE, SET or CHOICE: root, additions and tail."""
        assert isinstance(typed.type, syntax.Structure)
        members = typed.type.members
        yield from self.members((*members.root, *members.additions, *members.tail), typed.scope)


def instance_name(template: str, scope: Scope) -> str:
    """Return the name of a template's instance, <template>-<actual parameters>, as an ASN.1 name."""
    words = [re.sub(r"[^A-Za-z0-9]+", "-", bound.actual.text).strip("-") for bound in scope.bound.values()]
    return "-".join([template, *words])


def _alike(name: str, names: Iterable[str]) -> str:
    """Return similar names, as a question: "; ActionId?"."""
    known = list(names)
    same = [one for one in known if one.lower() == name.lower()]
    alike = same or difflib.get_close_matches(name, known, n=3)
    return f"; {' or '.join(alike)}?" if alike else ""
