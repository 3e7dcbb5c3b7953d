"""Files of a user's message: reads them, and gives their modules keys."""

import difflib
import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

from asn1.importer import syntax
from asn1.importer.crosscheck import crosscheck
from asn1.importer.fault import ImportFault, Problem, fault
from asn1.importer.module_parser import Reading, read
from asn1.own import identifier

_Found: TypeAlias = tuple[syntax.Module, str, str]
"""A module, the name of its file, and the SHA-256 of that."""


class Own(NamedTuple):
    """A module of a file. sha256: of the file's octets."""

    key: str
    module: syntax.Module
    file: str
    sha256: str


class Files(NamedTuple):
    """reading: of all files together. texts: of each file, with its name and what it gave."""

    modules: list[Own]
    reading: Reading
    texts: list[tuple[str, str, Reading]]


def read_files(paths: Sequence[Path], name: str, pdu: str) -> Files:
    """Read the files of a message. Raises ImportFault where the PDU is unreadable.

    name  of the message.
    """
    found: list[_Found] = []
    texts: list[tuple[str, str, Reading]] = []
    problems: list[Problem] = []
    lost: set[str] = set()
    for path in paths:
        octets = path.read_bytes()
        words, digest = octets.decode("utf-8", "replace"), hashlib.sha256(octets).hexdigest()
        try:
            reading = read(words, path.name)
        except ImportFault as error:
            problems += error.problems
            continue
        texts.append((words, path.name, reading))
        problems += reading.problems
        lost |= reading.lost
        found += [(module, path.name, digest) for module in reading.modules]
    modules = _each_once(found, problems)
    if pdu in lost or not modules or (problems and not any(pdu in one.assignments for one, _, _ in modules)):
        raise ImportFault(problems)
    own = [Own(key(name, number), *one) for number, one in enumerate(modules)]
    return Files(own, Reading([one.module for one in own], problems, lost), texts)


def compare(files: Files) -> list[Problem]:
    """Return why asn1tools could not read a file. Raises ImportFault where it reads something else, MissingError."""
    notes = [crosscheck(words, file, reading.modules) for words, file, reading in files.texts]
    return [note for note in notes if note]


def key(name: str, number: int) -> str:
    """Return the key of a module: x_<name>, x1_<name>, ..., so that two messages share none."""
    return f"x{number or ''}_" + re.sub(r"[.-]", "_", name)


def no_type(paths: Sequence[Path], pdu: str) -> str | None:
    """Say why a type cannot be the PDU; None for files with mistakes, of which `add` reports all."""
    modules: list[syntax.Module] = []
    for path in paths:
        try:
            reading = read(path.read_bytes().decode("utf-8", "replace"), path.name)
        except ImportFault:
            return None
        if reading.problems or pdu in reading.lost:
            return None
        modules += reading.modules
    return None if module_with(pdu, modules) else no_pdu(pdu, [path.name for path in paths], modules)


def module_with(pdu: str, modules: Sequence[syntax.Module]) -> syntax.Module | None:
    """Return the first module that defines a type."""
    return next((one for one in modules if isinstance(one.assignments.get(pdu), syntax.TypeAssignment)), None)


def no_pdu(pdu: str, files: Sequence[str], modules: Sequence[syntax.Module]) -> str:
    """Say that no module defines a type, and which ones they define."""
    known = [
        name for module in modules for name, one in module.assignments.items() if isinstance(one, syntax.TypeAssignment)
    ]
    alike = difflib.get_close_matches(pdu, known, n=3)
    one = len(files) == 1
    hint = (
        f"did you mean {' or '.join(alike)}?"
        if alike
        else f"{'it defines' if one else 'they define'} {', '.join(known)}"
    )
    return f"{pdu}: {' and '.join(files)} {'defines' if one else 'define'} no such type; {hint}"


def _each_once(found: Sequence[_Found], problems: list[Problem]) -> list[_Found]:
    """Without copies; two texts of one name and identifier are a problem."""
    kept: dict[tuple[str, tuple[identifier.Arc, ...]], _Found] = {}
    for one in found:
        module = one[0]
        first = kept.setdefault((module.name, identifier.arcs(module.oid)), one)[0]
        if first.body != module.body:
            problems += fault(
                module.place, f"module {module.name} differs from its definition at {first.place}; remove one"
            ).problems
    return list(kept.values())
