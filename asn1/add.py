"""A message of somebody's own: one .asn file becomes a schema and a message beside those of the standards.

What the file imports comes from the schemas that are here: the standards' files are not needed.
"""

import difflib
import hashlib
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from asn1 import asn, selection, text
from asn1.announced import obstacle
from asn1.importer import syntax
from asn1.importer.crosscheck import crosscheck
from asn1.importer.fault import ImportFault, Place, Problem, fault
from asn1.importer.feasible import require_feasible
from asn1.importer.module_parser import Reading, parse, read
from asn1.importer.program import Source
from asn1.importer.resolver import Resolved, Resolver
from asn1.importer.units import read_units
from asn1.layout import lay_out
from asn1.types import Message, Module, Reference, Schema

NAME = re.compile(r"[a-z][a-z0-9]*([.-][a-z0-9]+)*")
RELEASE = 2  # whose common data an experiment of today uses
NO_MODULE = "no module "
RANK = 99  # behind every edition of a standard


class Wish(NamedTuple):
    """What is asked for. versions: protocolVersion values that announce it; replace: a message of this name."""

    file: Path
    pdu: str
    name: str
    id: int
    port: int
    versions: tuple[int, ...] = (1, 2)
    replace: bool = False


class WishError(ValueError):
    """A wish that cannot be granted as it stands."""


class Added(NamedTuple):
    """imported: standards that the file takes something from; same_id: other messages with its messageID.

    note: why asn1tools could not compare the file; unannounced: why octets 0 and 1 do not tell the message.
    """

    message: Message
    paths: tuple[Path, ...]
    imported: tuple[str, ...]
    same_id: tuple[str, ...]
    note: Problem | None
    unannounced: str | None


def add(wish: Wish, schema: Schema, folder: Path) -> Added:
    """Write <key>.schema per module and <name>.toml into a folder that `text.load_schema` reads.

    The same name again replaces the message if the wish says so. Raises WishError, ImportFault with every problem,
    MissingError, OSError.
    """
    _check(wish, schema)
    _check_name(wish, folder)
    octets = wish.file.read_bytes()
    words = octets.decode("utf-8", "replace")
    reading = read(words, wish.file.name)
    parsed = reading.modules
    own = _keys(wish, parsed)
    if wish.pdu in reading.lost or not parsed:
        raise ImportFault(reading.problems)
    for taken in own.values():
        if (folder / f"{taken}.schema").exists() and taken not in _keys_in(folder, wish.name):
            raise WishError(f"--name {wish.name}: another message has {taken}.schema; choose another name")
    key = own[_module_with(wish, parsed).name]
    sources, resolved = _resolved(wish, reading, own, key, schema)
    note = crosscheck(words, wish.file.name, parsed)
    digest = hashlib.sha256(octets).hexdigest()
    modules = [
        Module(one, sources[one].module.name, sources[one].module.oid, f"experimental: {wish.name}", wish.file.name,
               digest, resolved[one].definitions, resolved[one].classes, resolved[one].sets)
        for one in own.values() if one in resolved
    ]  # fmt: skip
    message = Message(
        wish.name, wish.name, RELEASE, f"experimental: {wish.name}", Reference(module=key, name=wish.pdu),
        (wish.id,), wish.versions, wish.port, RANK, is_experimental=True,
    )  # fmt: skip
    known = {**schema.modules, **{module.key: module for module in modules}}
    alone = Schema(known, {message.name: message})
    require_feasible(alone, sources)
    unannounced = obstacle(lay_out(alone, [message]).pdus[message.name])
    imported = tuple(
        schema.modules[one].standard for one in resolved if one in schema.modules and one not in own.values()
    )
    same_id = tuple(one.name for one in schema.messages.values() if wish.id in one.ids and one.name != wish.name)
    for stale in set(_keys_in(folder, wish.name)) - {module.key for module in modules}:
        (folder / f"{stale}.schema").unlink()
    return Added(message, tuple(_write(folder, modules, message)), imported, same_id, note, unannounced)


def remove(name: str, folder: Path) -> list[Path]:
    """Take away what `add` has written for a message. Returns the files. Raises WishError, OSError."""
    here = text.load_schema(folder, editions=Path(os.devnull))
    mine = sorted(one.name for one in here.messages.values() if one.is_experimental)
    if name not in mine:
        known = f"there are {', '.join(mine)}" if mine else "there is none"
        raise WishError(f"{name}: no message of your own in {folder}; {known}")
    keys = _keys_in(folder, name)
    for other in here.modules:
        needed = set(keys) & selection.neighbours(here, other)
        if other not in keys and needed:
            raise WishError(f"{name}: {other}.schema takes types from {min(needed)}.schema; remove that message first")
    paths = [folder / f"{name}.toml", *(folder / f"{key}.schema" for key in keys)]
    for path in paths:
        path.unlink()
    return paths


def _keys_in(folder: Path, name: str) -> list[str]:
    """Keys of the modules that were written for a message."""
    paths = sorted(folder.glob("x_*.schema"))
    return [path.stem for path in paths if f"\nstandard experimental: {name}\n" in path.read_text(encoding="utf-8")]


def _resolved(
    wish: Wish, reading: Reading, own: Mapping[str, str], key: str, schema: Schema
) -> tuple[dict[str, Source], dict[str, Resolved]]:
    """The modules that are read together, and what the PDU reaches. Raises ImportFault with every problem."""
    problems = [*reading.problems]
    sources = _sources(reading.modules, own, schema, problems)
    resolved: dict[str, Resolved] = {}
    try:
        resolved = Resolver(sources, read_units()).resolve([(key, wish.pdu, Place(wish.file.name, 1))])
    except ImportFault as error:
        told = {problem.place for problem in problems if problem.text.startswith(NO_MODULE)}
        problems += [
            problem for problem in reading.others(error.problems)
            if not (problem.text.startswith(NO_MODULE) and problem.place in told)
        ]  # fmt: skip
    if problems:
        raise ImportFault(problems)
    return sources, resolved


def _check(wish: Wish, schema: Schema) -> None:
    wrong_name = no_name(wish.name, schema)
    if wrong_name:
        raise WishError(f"--name {wrong_name}")
    if not 0 <= wish.id <= 255:
        raise WishError(f"--id {wish.id}: a messageID is one octet, 0 to 255")
    if not 0 <= wish.port <= 65535:
        raise WishError(f"--port {wish.port}: a BTP port is 0 to 65535")
    wrong = [number for number in wish.versions if not 0 <= number <= 255]
    if wrong:
        raise WishError(f"--versions {wrong[0]}: a protocolVersion is one octet, 0 to 255")


def no_name(name: str, schema: Schema) -> str | None:
    """Why a message of one's own cannot be called so."""
    if not NAME.fullmatch(name):
        return f"{name}: small letters and digits, with hyphens between: my-msg"
    for message in schema.messages.values():
        if name in (message.name, message.type) and not message.is_experimental:
            return f"{name}: {message.standard} is called so; choose another name"
    return None


def no_type(file: Path, pdu: str) -> str | None:
    """Why a type cannot be the PDU; of a file that has mistakes `add` tells them all."""
    try:
        reading = read(file.read_bytes().decode("utf-8", "replace"), file.name)
    except ImportFault:
        return None
    return None if reading.problems or pdu in reading.lost else _no_pdu(file.name, pdu, reading.modules)


def _check_name(wish: Wish, folder: Path) -> None:
    if not wish.replace and (folder / f"{wish.name}.toml").exists():
        raise WishError(
            f"--name {wish.name}: {folder / wish.name}.toml is there already; --replace takes this one instead, "
            f"`captain-asn1 remove {wish.name}` takes it away"
        )


def _keys(wish: Wish, parsed: list[syntax.Module]) -> dict[str, str]:
    """Keys of the file's own modules: x_<name of the message>, with a number where there are several."""
    stem = "x_" + re.sub(r"[.-]", "_", wish.name)
    return {module.name: stem + (f"_{number}" if number else "") for number, module in enumerate(parsed)}


def _module_with(wish: Wish, parsed: list[syntax.Module]) -> syntax.Module:
    """The module that defines the PDU."""
    for module in parsed:
        if isinstance(module.assignments.get(wish.pdu), syntax.TypeAssignment):
            return module
    raise WishError(f"--pdu {_no_pdu(wish.file.name, wish.pdu, parsed)}")


def _no_pdu(file: str, pdu: str, parsed: list[syntax.Module]) -> str | None:
    known = [
        name for module in parsed for name, one in module.assignments.items() if isinstance(one, syntax.TypeAssignment)
    ]
    if pdu in known:
        return None
    alike = difflib.get_close_matches(pdu, known, n=3)
    hint = f"did you mean {' or '.join(alike)}?" if alike else f"it defines {', '.join(known)}"
    return f"{pdu}: {file} defines no such type; {hint}"


# ---------------------------------------------------------------- what the file imports


def _sources(
    parsed: list[syntax.Module], own: Mapping[str, str], schema: Schema, problems: list[Problem]
) -> dict[str, Source]:
    """The file's modules, and of the schema those that they reach, by key; modules that there are not are problems."""
    sources: dict[str, Source] = {}
    start: set[str] = set()
    for module in parsed:
        imports = dict(own)
        for one in module.imports.values():
            try:
                if one.module not in own:
                    imports[one.module] = _edition(one, schema)
            except ImportFault as error:
                problems += error.problems
        sources[own[module.name]] = Source(own[module.name], module, imports)
        start |= set(imports.values()) - set(own.values())
    for key in selection.reached(schema, start):
        (again,) = parse(asn.text(schema, schema.modules[key]), f"{key}.schema")
        others = selection.neighbours(schema, key)
        sources[key] = Source(key, again, {schema.modules[other].name: other for other in others})
    return sources


def _edition(wanted: syntax.Import, schema: Schema) -> str:
    """The key of the module that an import means: that with the same object identifier, else the newest."""
    found = [module for module in schema.modules.values() if module.name == wanted.module]
    if not found:
        names = sorted({module.name for module in schema.modules.values()})
        alike = difflib.get_close_matches(wanted.module, names, n=3)
        hint = f"; did you mean {' or '.join(alike)}?" if alike else "; the schema has " + ", ".join(names)
        raise fault(wanted.place, f"{NO_MODULE}{wanted.module}{hint}")
    exact = [module for module in found if _numbers(module.oid) == _numbers(wanted.oid)]
    return max(exact or found, key=lambda module: (module.key, _numbers(module.standard))).key


def _numbers(words: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", words)))


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
