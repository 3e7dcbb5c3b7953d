"""User-defined message: makes a schema and a message from its .asn files.

Imports are resolved from the project's schemas, so that the files of the standards are not needed.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from asn1.backends.asn import text as asn
from asn1.importer.feasible import require_feasible
from asn1.importer.parser.fault import ImportFault, Place, Problem, fault
from asn1.importer.parser.module_parser import parse
from asn1.importer.resolver.program import Source
from asn1.importer.resolver.resolver import Resolved, Resolver
from asn1.importer.resolver.units import read_units
from asn1.layout.layout import lay_out
from asn1.model import selection, text
from asn1.model.types import Message, Module, Reference, Schema
from asn1.own import files, identifier, imports
from asn1.own.announced import obstacle
from asn1.own.wish import STANDARD, UserRequest, WishError, check, no_name

__all__ = ["Added", "UserRequest", "WishError", "add", "no_name", "no_type", "remove"]

RELEASE = 2  # release of the common data dictionary that new experiments use
RANK = 99  # rank of a user's message: a higher number means less preferred, and standards have smaller ones

no_type = files.no_type


class Added(NamedTuple):
    """Result of add().

    imported     documents of the standards from which types are imported.
    same_id      names of other messages with the same messageID.
    notes        files that asn1tools could not compare, and choices made for ambiguous imports.
    unannounced  reason why octets 0 and 1 do not identify the message; None if they do.
    """

    message: Message
    paths: tuple[Path, ...]
    imported: tuple[str, ...]
    same_id: tuple[str, ...]
    notes: tuple[str, ...]
    unannounced: str | None


class _Reached(NamedTuple):
    """Modules that are read together, the definitions that the PDU uses, and notes about imports."""

    sources: dict[str, Source]
    resolved: dict[str, Resolved]
    notes: list[str]


def add(wish: UserRequest, schema: Schema, folder: Path) -> Added:
    """Write <key>.schema for each module and <name>.toml to a folder that `text.load_schema` reads.

    An existing message of this name is replaced only if `wish.replace` is true.
    Raises WishError for an invalid request, ImportFault with all problems of the files, MissingError without asn1tools,
    OSError if a file cannot be read or written.
    """
    check(wish, schema, folder)
    read = files.read_files(wish.files, wish.name, wish.pdu)
    own = read.modules
    for one in own:
        if (folder / f"{one.key}.schema").exists() and one.key not in _keys_in(folder, wish.name):
            raise WishError(f"--name {wish.name}: another message has {one.key}.schema; choose another name")
    key = _key_of_pdu(wish, own)
    reached = _reached(wish, read, key, schema)
    uncompared = files.compare(read)
    modules = [
        Module(one.key, one.module.name, one.module.oid, f"{STANDARD}{wish.name}", one.file,
               one.sha256, found.definitions, found.classes, found.sets)
        for one in own if (found := reached.resolved.get(one.key))
    ]  # fmt: skip
    message = Message(
        wish.name, wish.name, RELEASE, f"{STANDARD}{wish.name}", Reference(module=key, name=wish.pdu),
        (wish.id,), wish.versions, wish.port, RANK, is_experimental=True,
    )  # fmt: skip
    known = {**schema.modules, **{module.key: module for module in modules}}
    alone = Schema(known, {message.name: message})
    require_feasible(alone, reached.sources)
    unannounced = obstacle(lay_out(alone, [message]).pdus[message.name])
    keys = {one.key for one in own}
    standards = tuple(known[one].standard for one in reached.resolved if one not in keys)
    same_id = tuple(one.name for one in schema.messages.values() if wish.id in one.ids and one.name != wish.name)
    for stale in set(_keys_in(folder, wish.name)) - {module.key for module in modules}:
        (folder / f"{stale}.schema").unlink()
    notes = (*map(str, uncompared), *reached.notes, *_copies(modules, schema, wish.name))
    return Added(message, tuple(_write(folder, modules, message)), standards, same_id, notes, unannounced)


def remove(name: str, folder: Path) -> list[Path]:
    """Remove the files that `add` wrote for a message. Returns their paths.

    Raises WishError if no user-defined message has this name, or if another message imports types from it; OSError if a
    file cannot be removed.
    """
    here = text.load_schema(folder, editions=Path(os.devnull))
    mine = sorted(one.name for one in here.messages.values() if one.is_experimental)
    if name not in mine:
        known = f"choose one of {', '.join(mine)}" if mine else "add one with `captain-asn1 add`"
        raise WishError(f"{name}: not a message of your own in {folder}; {known}")
    keys = _keys_in(folder, name)
    for other in here.modules:
        needed = set(keys) & selection.neighbours(here, other)
        if other not in keys and needed:
            raise WishError(f"{name}: {other}.schema uses types of {min(needed)}.schema; remove its message first")
    paths = [folder / f"{name}.toml", *(folder / f"{key}.schema" for key in keys)]
    for path in paths:
        path.unlink()
    return paths


def _keys_in(folder: Path, name: str) -> list[str]:
    """Return the keys of the modules that were written for a message."""
    paths = sorted(folder.glob("x*_*.schema"))
    return [path.stem for path in paths if f"\nstandard {STANDARD}{name}\n" in path.read_text(encoding="utf-8")]


def _key_of_pdu(wish: UserRequest, own: Sequence[files.Own]) -> str:
    modules = [one.module for one in own]
    module = files.module_with(wish.pdu, modules)
    if module is None:
        raise WishError(f"--pdu {files.no_pdu(wish.pdu, [path.name for path in wish.files], modules)}")
    return own[modules.index(module)].key


def _copies(modules: Sequence[Module], schema: Schema, name: str) -> list[str]:
    """Return a note for each own module with name and identifier of a standard's module: only this message uses it."""
    standards = {
        (one.name, identifier.arcs(one.oid)): one.standard
        for one in schema.modules.values()
        if one.oid and not imports.is_of_user(one)
    }
    return [
        f"{one.source}: {one.name} has the name and identifier of {found}; only {name} uses the one of your file"
        for one in modules
        if (found := standards.get((one.name, identifier.arcs(one.oid))))
    ]


# ---------------------------------------------------------------- imports of the files


def _reached(wish: UserRequest, read: files.Files, key: str, schema: Schema) -> _Reached:
    """Resolve the definitions that the message uses. Raises ImportFault with every problem."""
    problems, notes = [*read.reading.problems], list[str]()
    sources = _sources(read.modules, schema, problems, notes)
    resolved: dict[str, Resolved] = {}
    try:
        resolved = Resolver(sources, read_units()).resolve([(key, wish.pdu, Place(wish.file.name, 1))])
    except ImportFault as error:
        refused = (imports.NO_MODULE, imports.NO_VERSION)
        told = {problem.place for problem in problems if problem.text.startswith(refused)}
        problems += [
            problem for problem in read.reading.others(error.problems)
            if not (problem.text.startswith(imports.NO_MODULE) and problem.place in told)
        ]  # fmt: skip
    if problems:
        raise ImportFault(problems)
    return _Reached(sources, resolved, notes)


def _sources(own: Sequence[files.Own], schema: Schema, problems: list[Problem], notes: list[str]) -> dict[str, Source]:
    """Return the files' modules and the standards' modules that these reach, by key.

    Adds failed imports to `problems`.
    """
    mine = {one.key: one.module for one in own}
    candidates = [*imports.of_files(mine.items()), *imports.of_standards(schema.modules.values())]
    others = [module for module in schema.modules.values() if imports.is_of_user(module)]
    sources: dict[str, Source] = {}
    for one in own:
        keys = {module.name: key for key, module in reversed(mine.items())}
        chosen: dict[str, str] = {}
        for wanted in dict.fromkeys(one.module.imports.values()):
            try:
                choice = imports.choose(wanted, candidates, others)
                if chosen.setdefault(wanted.module, choice.key) != choice.key:
                    raise fault(wanted.place, f"imports from two editions of {wanted.module}")
                notes += [choice.note] if choice.note else []
            except ImportFault as error:
                problems += error.problems
        sources[one.key] = Source(one.key, one.module, {**keys, **chosen})
    reached = {key for source in sources.values() for key in source.imports.values()} - set(mine)
    return sources | _standards(schema, reached)


def _standards(schema: Schema, keys: set[str]) -> dict[str, Source]:
    """Return modules of standards and all that they reach.

    Each is written as ASN.1 text from the schema, and parsed again.
    """
    sources: dict[str, Source] = {}
    for key in selection.reached(schema, keys):
        module = schema.modules[key]
        (again,) = parse(asn.text(schema, module), f"{key}.schema")
        names = {schema.modules[other].name: other for other in selection.neighbours(schema, key)}
        sources[key] = Source(key, again, names, module.standard, frozenset(module.left_out))
    return sources


# ---------------------------------------------------------------- writing


def _write(folder: Path, modules: list[Module], message: Message) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    texts = {f"{module.key}.schema": text.dump(module) for module in modules}
    texts[f"{message.name}.toml"] = _toml(message)
    for name, content in texts.items():
        (folder / name).write_text(content, encoding="utf-8")
    return [folder / name for name in texts]


def _toml(message: Message) -> str:
    lines = [
        f"name = {json.dumps(message.name)}",
        f"type = {json.dumps(message.type)}",
        f"release = {message.release}",
        f"standard = {json.dumps(message.standard)}",
        f'pdu = "{message.pdu.module}.{message.pdu.name}"',
        f"ids = {list(message.ids)}",
        f"versions = {list(message.versions)}",
        f"btp_port = {message.btp_port}",
        f"rank = {message.rank}",
        "experimental = true",
    ]
    return "\n".join(["[[message]]", *lines, ""])
