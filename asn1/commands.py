"""Commands of `captain-asn1`."""

import argparse
import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from asn1.backends.backend import Job, OwnOption
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2.options import Ros2Options
from asn1.model import selection, text
from asn1.model.types import Message, Schema
from asn1.progress import Steps

if TYPE_CHECKING:
    from asn1.own.station import TypeRow, Types


class CommandError(ValueError):
    """Error of the user; str() gives error and remedy."""


class UsageError(CommandError):
    """Invalid command line."""


def list_messages(args: argparse.Namespace) -> int:
    """Print a table of all messages, cut at the width of a terminal, or one JSON object per line.

    Raises CommandError if a directory of --with has no schema, or a schema that another directory also has.
    """
    schema = _schema(args.with_)
    if args.json:
        for message in schema.messages.values():
            print(json.dumps(_facts(message)))
        return 0
    rows = [("message", "release", "BTP port", "standard"), *map(_row, schema.messages.values())]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    for row in rows:
        line = "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        print(line if len(line) <= columns else f"{line[: columns - 2]}..")
    return 0


def generate(args: argparse.Namespace) -> int:
    """Write the requested format, and print the next step.

    Raises UsageError without messages, with contradicting choices of messages, and for an option of another format.
    Raises CommandError if a directory of --with has no schema, or a schema that another directory also has.
    """
    if not (args.messages or args.standard or args.all):
        raise UsageError("generate: no messages chosen; name messages, or add --standard or --all")
    if bool(args.messages) + args.standard + args.all > 1:
        raise UsageError("names, --standard and --all exclude each other; use one of them")
    _check_options(args)
    schema = _schema(args.with_)
    if args.all:
        messages = tuple(schema.messages)
    elif args.standard:
        messages = selection.standard(schema)
    else:
        messages = selection.named(schema, args.messages)
    backend = BACKENDS[args.form]
    before = backend.parts(args.to)
    changed = write(schema, messages, args)
    print(f"{args.to}: {_count(len(messages), 'message')} in format {args.form}; {_count(changed, 'file')} changed")
    if gone := sorted(before - backend.parts(args.to)):
        print(f"removed messages that this command line did not name: {', '.join(gone)}")
    print(backend.next_step.format(folder=args.to))
    return 0


def _check_options(args: argparse.Namespace) -> None:
    """Raise UsageError for an option that the format does not have."""
    option: OwnOption
    for option in get_args(OwnOption):
        if getattr(args, option) and option not in BACKENDS[args.form].options:
            forms = [name for name, backend in BACKENDS.items() if option in backend.options]
            raise UsageError(
                f"--{option}: not an option of --format {args.form}; it needs --format {' or '.join(forms)}"
            )


def write(schema: Schema, messages: tuple[str, ...], args: argparse.Namespace) -> int:
    """Write one format to its directory. Returns the number of changed files."""
    ros2 = Ros2Options(args.profile or "etsi_its", args.distro or "jazzy", args.ros2)
    backend, job = BACKENDS[args.form], Job(schema, messages, ros2)
    steps = Steps(backend.steps(job))
    try:
        return backend.write(job, args.to, steps)
    finally:
        steps.finish()


def _schema(folders: list[Path]) -> Schema:
    """Return the project's schema, merged with those that `add` has written to other directories."""
    schema = text.load_schema()
    modules, messages = dict(schema.modules), dict(schema.messages)
    for folder in folders:
        if not any(folder.glob("*.schema")):
            raise CommandError(f"--with {folder}: contains no schema; `captain-asn1 add ... --to {folder}` writes one")
        more = text.load_schema(folder, editions=Path(os.devnull))
        if twice := sorted(modules.keys() & more.modules):
            raise CommandError(
                f"--with {folder}: {twice[0]}.schema is in another directory, too; remove one of the two"
            )
        modules |= more.modules
        messages |= more.messages
    return Schema(modules, messages)


def _with_modules(folder: Path) -> Path:
    """Return the folder, or a list of addresses. Raises CommandError for a folder without a file of editions.toml."""
    from asn1.importer import standards

    if not folder.is_file() and (example := standards.missing_file(folder)):
        raise CommandError(f"{folder}: contains no file of editions.toml; name the directory with {example}")
    return folder


def _row(message: Message) -> tuple[str, str, str, str]:
    release = f"{message.release}{' experimental' if message.is_experimental else ''}"
    return message.name, release, str(message.btp_port), message.standard


def _facts(message: Message) -> dict[str, object]:
    return {
        "name": message.name,
        "type": message.type,
        "release": message.release,
        "standard": message.standard,
        "module": message.pdu.module,
        "pdu": message.pdu.name,
        "ids": message.ids,
        "versions": message.versions,
        "btp_port": message.btp_port,
        "is_experimental": message.is_experimental,
    }


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def import_standards(args: argparse.Namespace) -> int:
    """Import the schema from the modules of the standards.

    Raises CommandError for a folder without any of their files.
    """
    from asn1.importer import standards

    schema = standards.import_modules(_with_modules(args.folder), tell=print)
    changed = standards.write_schema(schema)
    for path in changed:
        print(f"changed: {path}")
    print(f"{_count(len(schema.modules), 'module')} read, {_count(len(changed), 'schema')} changed")
    return 0


def check_import(args: argparse.Namespace) -> int:
    """Import the standards' modules and compare: print each difference from the schema and the C of this tree.

    Returns 0 without a difference, else 1. Raises CommandError for a folder without any file of the standards.
    """
    from asn1.backends.c.form import differences
    from asn1.importer import standards

    here, imported = _schema([]), standards.import_modules(_with_modules(args.folder), tell=print)
    lines = standards.compare(imported, args.folder)
    for line in lines:
        print(line)
    if lines:
        print("the schema differs", file=sys.stderr)
        return 1
    messages = tuple(name for name in imported.messages if name in here.messages)
    files = differences(here, imported, messages)
    for file in files:
        print(f"differs: {file}")
    if files:
        return 1
    print(f"{_count(len(imported.modules), 'module')} imported: schema and codecs are equal to the committed ones")
    return 0


def add_message(args: argparse.Namespace) -> int:
    """Add a user-defined message, and register it with the station.

    Raises CommandError if its file, name or a number is invalid, or if the station's file is.
    """
    from asn1.own import add, station

    row = station.TypeRow(
        args.id, station.type_name(args.name), args.port, args.priority, args.lifetime, args.traffic_class
    )
    first, *others = args.file
    versions = tuple(args.versions)
    wish = add.UserRequest(first, args.pdu, args.name, args.id, args.port, versions, args.replace, tuple(others))
    try:
        row.check()
        types = _types()
        added = add.add(wish, schema := _schema([]), args.to)
    except add.WishError as error:
        raise CommandError(str(error)) from error
    for path in added.paths:
        print(f"written: {path}")
    for note in added.notes:
        print(note)
    for standard in dict.fromkeys(added.imported):
        print(f"types are imported from {standard}")
    if added.same_id:
        print(f"messageID {wish.id} is also that of {', '.join(added.same_id)}; `captain decode` tries all of them")
    if added.unannounced:
        print(
            f"captain-asn1: warning: octets 0 and 1 are not protocolVersion and messageID: {added.unannounced}.\n"
            f"  `captain decode` does not find it by messageID {wish.id} and needs --edition {wish.name}.\n"
            "  Begin with an ItsPduHeader, in a SEQUENCE without ... and OPTIONAL.",
            file=sys.stderr,
        )
    _register(row, types, schema)
    if args.to == text.SCHEMA:
        print(f"next: `make codec` builds {wish.name} into the Python module; captain-asn1 generate makes C")
    else:
        command = f"captain-asn1 generate {wish.name} --with {args.to} --format FORM --to DIR"
        print(f"next: `{command}`")
    return 0


def remove_message(args: argparse.Namespace) -> int:
    """Remove a user-defined message, and its row from the station's file.

    Raises CommandError if no message has this name, or if the station's file is invalid.
    """
    from asn1.own import add, station

    try:
        types = _types()
        paths = add.remove(args.name, args.to)
    except add.WishError as error:
        raise CommandError(str(error)) from error
    for path in paths:
        print(f"removed: {path}")
    name = station.type_name(args.name)
    if types is not None and types.remove(name):
        print(f"removed: type {name} from {types.path}; restart your stations")
    return 0


def _types() -> "Types | None":
    """Return the station's file of own types; None if the user wants none. Raises WishError if it is invalid."""
    from asn1.own import station

    path = station.file_of()
    return station.Types(path) if path else None


def _register(row: "TypeRow", types: "Types | None", schema: Schema) -> None:
    """Register a message with the station, and print what was written, or why not."""
    if types is None:
        print("not registered with the station: CAPTAIN_TYPES is empty")
        return
    standards = [one.name for one in schema.messages.values() if row.number in one.ids and not one.is_experimental]
    if standards:
        reason: str | None = (
            f"messageID {row.number} is that of {standards[0]}; to replace it, write [[types]] in captain.toml"
        )
    else:
        reason = types.add(row)
    if reason:
        print(f"captain-asn1: warning: not registered with the station: {reason}", file=sys.stderr)
        return
    print(
        f"registered in {types.path}: type {row.name}, messageID {row.number}, BTP port {row.btp_port}, "
        f"traffic class {row.traffic_class}, priority {row.priority}, lifetime {row.lifetime_s:g} s"
    )
    print("stations that run take a new type within a second; they take a changed one when they are restarted")


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "list": list_messages,
    "generate": generate,
    "import": import_standards,
    "import-check": check_import,
    "add": add_message,
    "remove": remove_message,
}
