"""What the commands of `captain-asn1` do."""

import argparse
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

from asn1 import add, library, selection, text
from asn1.progress import Steps
from asn1.ros2 import RosError
from asn1.types import Message, Schema


class CommandError(ValueError):
    """What a user can put right; str() says what and how."""


class UsageError(CommandError):
    """A command line that makes no sense."""


def list_messages(args: argparse.Namespace) -> int:
    """A table of all messages, or a JSON object a line."""
    schema = _schema(args.with_)
    if args.json:
        for message in schema.messages.values():
            print(json.dumps(_facts(message)))
        return 0
    rows = [("message", "release", "BTP port", "standard"), *map(_row, schema.messages.values())]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    for row in rows:
        print("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
    return 0


def generate(args: argparse.Namespace) -> int:
    """Write what was asked for, and say what to do with it."""
    if not (args.messages or args.standard or args.all):
        raise UsageError("generate what? name messages, or give --standard or --all")
    if bool(args.messages) + args.standard + args.all > 1:
        raise UsageError("names, --standard and --all exclude each other")
    _check_form(args)
    schema = _schema(args.with_)
    if args.all:
        messages = tuple(schema.messages)
    elif args.standard:
        messages = selection.standard(schema)
    else:
        messages = selection.named(schema, args.messages)
    before = _packages(args)
    changed = write(schema, messages, args)
    print(f"{args.to}: {_count(len(messages), 'message')} as {args.form}, {_count(changed, 'file')} changed")
    if gone := sorted(before - _packages(args)):
        print(f"removed, as they were not asked for again: {', '.join(gone)}")
    print(library.NEXT[args.form].format(folder=args.to))
    return 0


def _check_form(args: argparse.Namespace) -> None:
    """Options that the form does not have are no wishes that nobody hears."""
    for name in ("profile", "distro"):
        if getattr(args, name) is not None and args.form != "ros2":
            raise UsageError(f"--{name} is of the form ros2, not of {args.form}")
    if args.ros2 and args.form not in library.WITH_CODE:
        raise UsageError(f"--ros2 is of the forms {', '.join(library.WITH_CODE)}, not of {args.form}")


def _packages(args: argparse.Namespace) -> set[str]:
    """Names of the ROS packages in the directory that is written."""
    return {path.parent.name for path in args.to.glob("*/package.xml")} if args.form == "ros2" else set()


def write(schema: Schema, messages: tuple[str, ...], args: argparse.Namespace) -> int:
    """One form into its directory; the count of files that have changed."""
    steps = Steps(library.steps(schema, messages, args.form, args.ros2))
    ros2 = library.Ros2(args.profile or "etsi_its", args.distro or "jazzy", args.ros2)
    try:
        return library.generate(schema, messages, args.form, args.to, steps, ros2)
    except RosError as error:
        raise CommandError(str(error)) from error
    finally:
        steps.finish()


def _schema(folders: list[Path]) -> Schema:
    """The schema of the project, and what `add` has put into other directories."""
    schema = text.load_schema()
    modules, messages = dict(schema.modules), dict(schema.messages)
    for folder in folders:
        if not any(folder.glob("*.schema")):
            raise CommandError(f"--with {folder}: no schema is there; `captain-asn1 add ... --to {folder}` makes one")
        more = text.load_schema(folder, editions=Path(os.devnull))
        if twice := sorted(modules.keys() & more.modules):
            raise CommandError(
                f"--with {folder}: {twice[0]}.schema is in another directory as well; remove one of the two"
            )
        modules |= more.modules
        messages |= more.messages
    return Schema(modules, messages)


def _with_modules(folder: Path) -> Path:
    """A list of addresses; or a directory, where at least one file is in it that editions.toml names."""
    from asn1.importer.editions import read_editions

    editions = [edition for edition in read_editions().modules.values() if not edition.is_ours]
    if not folder.is_file() and not any(edition.paths(folder) for edition in editions):
        example = editions[0].files[0]
        raise CommandError(f"{folder}: none of the files that editions.toml names is there, as {folder / example}")
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
    """The schema from the modules of the standards."""
    from asn1 import importer

    schema = importer.import_modules(_with_modules(args.folder), tell=print)
    changed = importer.write_schema(schema)
    for path in changed:
        print(f"changed: {path}")
    print(f"{_count(len(schema.modules), 'module')} read, {_count(len(changed), 'schema')} changed")
    return 0


def check_import(args: argparse.Namespace) -> int:
    """0 where the modules of the standards give the schema and the C that are here, else what differs and 1."""
    from asn1 import importer

    here, imported = _schema([]), importer.import_modules(_with_modules(args.folder), tell=print)
    lines = importer.compare(imported, args.folder)
    for line in lines:
        print(line)
    if lines:
        print("the schema differs", file=sys.stderr)
        return 1
    messages = tuple(name for name in imported.messages if name in here.messages)
    files = library.differences(here, imported, messages)
    for file in files:
        print(f"differs: {file}")
    if files:
        return 1
    print(f"{_count(len(imported.modules), 'module')}: the same schema and the same codecs, octet for octet")
    return 0


def add_message(args: argparse.Namespace) -> int:
    """A message of the user's own."""
    first, *others = args.file
    versions = tuple(args.versions)
    wish = add.Wish(first, args.pdu, args.name, args.id, args.port, versions, args.replace, tuple(others))
    try:
        added = add.add(wish, _schema([]), args.to)
    except add.WishError as error:
        raise CommandError(str(error)) from error
    for path in added.paths:
        print(f"written: {path}")
    for note in added.notes:
        print(note)
    for standard in dict.fromkeys(added.imported):
        print(f"it takes types from {standard}")
    if added.same_id:
        print(f"messageID {wish.id} also announces {', '.join(added.same_id)}: captain decode tries them in turn")
    if added.unannounced:
        print(
            f"captain-asn1: warning: octets 0 and 1 will not be protocolVersion and messageID: {added.unannounced}\n"
            f"  captain decode cannot find it by messageID {wish.id}: --edition {wish.name} is needed\n"
            "  (a SEQUENCE without ... and OPTIONAL, with an ItsPduHeader first, is found)",
            file=sys.stderr,
        )
    if args.to == text.SCHEMA:
        print(f"{wish.name}: in the Python module and captain decode after `make codec`; in C by captain-asn1 generate")
    else:
        command = f"captain-asn1 generate {wish.name} --with {args.to} --form FORM --to DIR"
        print(f"in the Python module and in C by `{command}`")
    return 0


def remove_message(args: argparse.Namespace) -> int:
    """A message of the user's own is taken away again."""
    try:
        paths = add.remove(args.name, args.to)
    except add.WishError as error:
        raise CommandError(str(error)) from error
    for path in paths:
        print(f"removed: {path}")
    return 0


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "list": list_messages,
    "generate": generate,
    "import": import_standards,
    "import-check": check_import,
    "add": add_message,
    "remove": remove_message,
}
