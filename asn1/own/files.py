"""Files of a user-defined message: parses them, and assigns keys to their modules."""

import difflib
import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

from asn1.importer.crosscheck import crosscheck
from asn1.importer.parser import syntax
from asn1.importer.parser.fault import ImportFault, Problem, fault
from asn1.importer.parser.module_parser import Reading, read
from asn1.own import identifier

_Found: TypeAlias = tuple[syntax.Module, str, str]
"""A module, the name of its file, and the SHA-256 of that."""


class Own(NamedTuple):
    """A module of a user's file. sha256: digest of the file's octets."""

    key: str
    module: syntax.Module
    file: str
    sha256: str


class Files(NamedTuple):
    """Files of a message, after parsing.

    reading  result for all files together.
    texts    for each file: its text, name and result.
    """

    modules: list[Own]
    reading: Reading
    texts: list[tuple[str, str, Reading]]


def read_files(paths: Sequence[Path], name: str, pdu: str) -> Files:
    """Parse the files of a message. Raises ImportFault if the PDU is unreadable.

    name  name of the message; the modules' keys contain it.
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
    """Compare the files with asn1tools. Returns a note for each file that it could not read.

    Raises ImportFault if asn1tools reads other types or values, MissingError if it is not installed.
    """
    notes = [crosscheck(words, file, reading.modules) for words, file, reading in files.texts]
    return [note for note in notes if note]


def key(name: str, number: int) -> str:
    """Return the key of a module: x_<name>, x1_<name>, ... The message's name makes it unique."""
    return f"x{number or ''}_" + re.sub(r"[.-]", "_", name)


def no_type(paths: Sequence[Path], pdu: str) -> str | None:
    """Return why a type cannot be the PDU; None if it can, or if the files have errors, which `add` reports."""
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
    """Return an error text: no module defines the type; with similar names, or all that are defined."""
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
    """Return the modules without duplicates. Adds a problem if two with the same name and identifier differ."""
    kept: dict[tuple[str, tuple[identifier.Arc, ...]], _Found] = {}
    for one in found:
        module = one[0]
        first = kept.setdefault((module.name, identifier.arcs(module.oid)), one)[0]
        if first.body != module.body:
            problems += fault(
                module.place, f"module {module.name} differs from its definition at {first.place}; remove one"
            ).problems
    return list(kept.values())
