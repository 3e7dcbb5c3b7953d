"""Imports: chooses the module of each by object identifier and version.

Modules of other users' messages are never chosen, so that adding, replacing or removing a message changes no other.
"""

import difflib
import re
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import fault
from asn1.model.types import Module
from asn1.own import identifier
from asn1.own.wish import STANDARD

NO_MODULE = "no module "
NO_VERSION = "unknown "

_SELECTIONS: dict[str, Callable[[tuple[identifier.Arc, ...], tuple[identifier.Arc, ...]], bool]] = {
    "SUCCESSORS": identifier.is_successor,
    "DESCENDANTS": identifier.is_descendant,
}


class Candidate(NamedTuple):
    """A module that an import may refer to.

    source  document of the standard, or name of the user's file.
    order   sort key: newer editions are greater.
    is_own  True for a module of the user's files.
    """

    key: str
    name: str
    oid: str
    source: str
    order: tuple[str, tuple[int, ...]]
    is_own: bool

    @property
    def arcs(self) -> tuple[identifier.Arc, ...]:
        return identifier.arcs(self.oid)


class Choice(NamedTuple):
    """Key of the chosen module. note: hint for the user, or ""."""

    key: str
    note: str = ""


def is_of_user(module: Module) -> bool:
    """Return whether a user added this module."""
    return module.standard.startswith(STANDARD)


def of_files(modules: Iterable[tuple[str, syntax.Module]]) -> list[Candidate]:
    """Return candidates for the modules of the user's files."""
    return [Candidate(key, one.name, one.oid, one.place.file, ("", ()), True) for key, one in modules]


def of_standards(modules: Iterable[Module]) -> list[Candidate]:
    """Return candidates for the schema's modules in the given order, without those that users added.

    A candidate's order is its release and all numbers of its document and version, from left to right: that of
    "ETSI TS 102 894-2 v2.4.1" is ("r2", (102, 894, 2, 2, 4, 1)).
    """
    return [
        Candidate(one.key, one.name, one.oid, one.standard, (one.key.partition("_")[0], _numbers(one.standard)), False)
        for one in modules
        if not is_of_user(one)
    ]


def choose(wanted: syntax.Import, candidates: Sequence[Candidate], others: Iterable[Module] = ()) -> Choice:
    """Choose the module of an import.

    candidates  modules of the user's files, followed by those of the standards.
    others      modules of other messages, for the hint.

    The identifier of the import must equal that of the module; with WITH SUCCESSORS a later one is accepted as well. A
    module without an identifier fits any. An import without an identifier takes the module of the user's files, or the
    newest edition. Raises ImportFault if no module has the name, or none has the version.
    """
    named = [one for one in candidates if one.name == wanted.module]
    if not named:
        raise fault(wanted.place, f"{NO_MODULE}{wanted.module}{_hint(wanted.module, candidates, others)}")
    arcs = identifier.arcs(wanted.oid)
    if not arcs:
        return _newest(wanted, [one for one in named if one.is_own] or named)
    allows = _SELECTIONS.get(wanted.selection)
    later = [one for one in named if allows and one.oid and allows(arcs, one.arcs)]
    for found in (
        [one for one in named if one.arcs == arcs],
        sorted(later, key=lambda one: one.arcs),
        [one for one in named if not one.oid],
    ):
        if found:
            return Choice(found[0].key)
    common = identifier.shared([arcs, *(one.arcs for one in named)])
    there = ", ".join(f"{identifier.behind(one.oid, common)} ({one.source})" for one in named)
    version = identifier.behind(wanted.oid, common)
    raise fault(wanted.place, f"{NO_VERSION}{version} of {wanted.module}; available: {there}")


def _newest(wanted: syntax.Import, named: Sequence[Candidate]) -> Choice:
    best = max(named, key=lambda one: one.order)
    if len(named) == 1:
        return Choice(best.key)
    note = (
        f"{wanted.place}: {wanted.module} has no object identifier here; using the newest of {len(named)} "
        f"({best.source}); to fix the version write FROM {wanted.module} {best.oid}"
    )
    return Choice(best.key, note)


def _hint(name: str, candidates: Sequence[Candidate], others: Iterable[Module]) -> str:
    for other in others:
        if other.name == name:
            owner = other.standard.removeprefix(STANDARD)
            return f"; {name} is in {other.source} of {owner}; add that file to the command"
    names = sorted({one.name for one in candidates})
    alike = difflib.get_close_matches(name, names, n=3)
    return f"; did you mean {' or '.join(alike)}?" if alike else "; the schema has " + ", ".join(names)


def _numbers(words: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", words)))
