"""Cross-check: compares our syntax tree of a module with that of asn1tools.

It compares names of modules, imports, types, values, classes and sets; components, alternatives and items in their
order; OPTIONAL and DEFAULT; named numbers and bits; a single constraint of ranges; a single SIZE. The tree of asn1tools
does not contain rows of object sets, actual parameters, serial constraints, WITH COMPONENTS, CONTAINING, ALL EXCEPT and
object identifiers. It does not distinguish an ellipsis inside SIZE from one after it.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import ImportFault, MissingError, Place, Problem

_Tree = dict[str, Any]

# Types that asn1tools cannot parse. For the comparison only, another type replaces them.
_INSTEAD = {"RELATIVE-OID": "BOOLEAN"}
_LINE = re.compile(r"line (\d+)")


def crosscheck(text: str, file: str, modules: Sequence[syntax.Module]) -> Problem | None:
    """Compare our syntax trees with those of asn1tools.

    Returns None if they are equal, or a note why nothing was compared if asn1tools cannot parse the text.
    Raises ImportFault with every difference, MissingError if asn1tools is not installed.
    """
    try:
        import asn1tools  # type: ignore[import-untyped]  # only this comparison needs it
    except ImportError:
        raise MissingError(
            "asn1tools, a second parser that checks every module, is not installed: pip install asn1tools"
        ) from None
    for word, instead in _INSTEAD.items():
        text = re.sub(rf"\b{word}\b", instead, text)
    try:
        trees: dict[str, _Tree] = asn1tools.parse_string(text + "\n")
    except asn1tools.ParseError as error:
        line = _LINE.search(str(error))
        place = Place(file, int(line[1]) if line else 1)
        return Problem(place, f"not compared: asn1tools does not read this: {error}")
    except (ValueError, TypeError, LookupError, AttributeError) as error:
        # asn1tools raises these, for example, for a DEFAULT of INTEGER by reference. Then it returns no tree.
        return Problem(Place(file, 1), f"not compared: asn1tools stops with {type(error).__name__}: {error}")
    problems = [problem for module in modules for problem in _module(module, trees.get(module.name))]
    if problems:
        raise ImportFault(problems)
    return None


def _module(ours: syntax.Module, theirs: _Tree | None) -> Iterator[Problem]:
    if theirs is None:
        yield _differs(ours.place, f"module {ours.name}", "there", "not there")
        return
    imported = sorted((one.module, name) for name, one in ours.imports.items())
    # asn1tools lists the braces after the name of a template as names, and accepts duplicate names.
    names_of = {(module, name) for module, names in theirs["imports"].items() for name in names}
    their_imports = sorted(pair for pair in names_of if pair[1] not in {"{", "}"})
    if imported != their_imports:
        yield _differs(ours.place, "imports", imported, their_imports)
    for kind, found in (
        (syntax.TypeAssignment, theirs["types"]),
        (syntax.ValueAssignment, theirs["values"]),
        (syntax.ClassAssignment, theirs["object-classes"]),
        (syntax.SetAssignment, theirs["object-sets"]),
    ):
        names = [one.name for one in ours.assignments.values() if isinstance(one, kind)]
        if names != list(found):
            yield _differs(ours.place, f"names of {kind.__name__}", names, list(found))
    for one in ours.assignments.values():
        match one:
            case syntax.TypeAssignment() if one.name in theirs["types"]:
                yield from _type(one.type, theirs["types"][one.name], one.name)
            case syntax.ValueAssignment() if one.name in theirs["values"]:
                if _name(one.type) not in {None, theirs["values"][one.name]["type"]}:
                    yield _differs(
                        one.place, f"type of {one.name}", _name(one.type), theirs["values"][one.name]["type"]
                    )
            case syntax.ClassAssignment() if one.name in theirs["object-classes"]:
                fields = [field.name for field in one.fields]
                members = [member["name"] for member in theirs["object-classes"][one.name]["members"]]
                if fields != members:
                    yield _differs(one.place, f"fields of {one.name}", fields, members)


def _type(ours: syntax.Type, theirs: _Tree, path: str) -> Iterator[Problem]:
    name = _name(ours)
    if name is not None and name != theirs["type"]:
        yield _differs(ours.place, f"the type of {path}", name, theirs["type"])
        return
    yield from _ranges(ours, theirs, path)
    match ours:
        case syntax.Structure():
            yield from _members(ours, theirs["members"], path)
        case syntax.ListOf():
            yield from _type(ours.element, theirs["element"], path)
        case syntax.Enumerated():
            yield from _enumerated(ours, theirs["values"], path)
        case syntax.WithItems(name="INTEGER"):
            yield from _items(ours, theirs.get("named-numbers", {}).items(), path)
        case syntax.WithItems():
            yield from _items(ours, theirs.get("named-bits") or [], path)


def _name(type_: syntax.Type) -> str | None:
    """Return the name that asn1tools gives to a type; None if it gives none."""
    match type_:
        case syntax.Plain(name=name):
            return _INSTEAD.get(name, name)
        case syntax.WithItems(name=name) | syntax.Structure(name=name):
            return name
        case syntax.Enumerated():
            return "ENUMERATED"
        case syntax.ListOf(is_set=is_set):
            return "SET OF" if is_set else "SEQUENCE OF"
        case syntax.Reference(name=name, module=None):
            return name
        case syntax.FieldOf(class_=class_, field=field):
            return f"{class_}.{field}"
    return None


def _members(ours: syntax.Structure, theirs: list[Any], path: str) -> Iterator[Problem]:
    members = ours.members
    flat: list[syntax.Member | None] = [*members.root]
    if members.is_extensible:
        flat += [None, *members.additions]
    if members.tail:
        flat += [None, *members.tail]
    # asn1tools keeps a second ellipsis even if no member follows it.
    while theirs and theirs[-1] is None and len(theirs) > len(flat):
        theirs = theirs[:-1]
    if len(flat) != len(theirs):
        yield _differs(ours.place, f"the number of members of {path}", len(flat), len(theirs))
        return
    for one, their in zip(flat, theirs, strict=True):
        yield from _member(one, their, path, ours.place)


def _member(ours: syntax.Member | None, theirs: Any, path: str, place: Place) -> Iterator[Problem]:
    match ours, theirs:
        case None, None:
            pass
        case syntax.Group(), list() if len(ours.components) == len(theirs):
            for one, their in zip(ours.components, theirs, strict=True):
                yield from _member(one, their, path, ours.place)
        case syntax.ComponentsOf(), {"components-of": name}:
            if _name(ours.type) != name:
                yield _differs(ours.place, f"COMPONENTS OF in {path}", _name(ours.type), name)
        case syntax.Component(), {"name": name}:
            yield from _component(ours, theirs, f"{path}.{ours.name}", name)
        case _:
            yield _differs(ours.place if ours else place, f"a member of {path}", ours and type(ours).__name__, theirs)


def _component(ours: syntax.Component, theirs: _Tree, path: str, name: str) -> Iterator[Problem]:
    if ours.name != name:
        yield _differs(ours.place, f"the name of {path}", ours.name, name)
        return
    if ours.is_optional != theirs.get("optional", False):
        yield _differs(ours.place, f"OPTIONAL of {path}", ours.is_optional, theirs.get("optional", False))
    if (ours.default is None) != ("default" not in theirs):
        yield _differs(ours.place, f"DEFAULT of {path}", ours.default is not None, "default" in theirs)
    yield from _type(ours.type, theirs, path)


def _enumerated(ours: syntax.Enumerated, theirs: list[tuple[str, int] | None], path: str) -> Iterator[Problem]:
    flat: list[syntax.Item | None] = [*ours.root]
    if ours.is_extensible:
        flat += [None, *ours.additions]
    names = [one and one.name for one in flat]
    their_names = [one and one[0] for one in theirs]
    if names != their_names:
        yield _differs(ours.place, f"the items of {path}", names, their_names)
        return
    for one, their in zip(flat, theirs, strict=True):
        # Only numbers in the text are compared. The others follow from a rule of X.680.
        if (
            one is not None
            and their is not None
            and isinstance(one.value, syntax.Number)
            and one.value.value != their[1]
        ):
            yield _differs(one.place, f"the number of {path}.{one.name}", one.value.value, their[1])


def _items(ours: syntax.WithItems, theirs: Iterable[tuple[str, Any]], path: str) -> Iterator[Problem]:
    mine = [(one.name, str(_end(one.value))) for one in ours.items if one.value is not None]
    other = [(name, str(value)) for name, value in theirs]
    if mine != other:
        yield _differs(ours.place, f"the names of {path}", mine, other)


# ---------------------------------------------------------------- constraints


def _ranges(ours: syntax.Type, theirs: _Tree, path: str) -> Iterator[Problem]:
    """Compare the ranges of a type with one constraint, or those of its SIZE."""
    if len(ours.constraints) != 1:
        return
    constraint = ours.constraints[0]
    key = "restricted-to"
    if isinstance(constraint.root, syntax.SizeOf):
        if constraint.is_extensible:
            return
        key, constraint = "size", constraint.root.constraint
    mine = _flat(constraint)
    if mine is None:
        return
    other = theirs.get(key)
    if mine != other:
        yield _differs(ours.constraints[0].place, f"the range of {path}", mine, other)


def _flat(constraint: syntax.Constraint) -> list[Any] | None:
    """Return ranges in the form of asn1tools; None for other constraints.

    The list contains (low, high), single values, and None for the ellipsis.
    """
    parts = _parts(constraint.root)
    if constraint.is_extensible:
        parts = parts and [*parts, None]
    if constraint.additions is not None:
        more = _parts(constraint.additions)
        parts = parts and more and [*parts, *more]
    return parts


def _parts(elements: syntax.Elements) -> list[Any] | None:
    match elements:
        case syntax.Single(value=syntax.Number() | syntax.Word() as value):
            return [_end(value)]
        case syntax.Between(excludes_low=False, excludes_high=False):
            return [(_end(elements.low), _end(elements.high))]
        case syntax.Union():
            found: list[Any] = []
            for member in elements.members:
                parts = _parts(member)
                if parts is None:
                    return None
                found += parts
            return found
    return None


def _end(value: syntax.Value) -> Any:
    match value:
        case syntax.Number():
            return value.value
        case syntax.Word():
            return value.name
    return None


def _differs(place: Place, what: str, ours: object, theirs: object) -> Problem:
    return Problem(place, f"{what}: we read {ours}, asn1tools {theirs}")
