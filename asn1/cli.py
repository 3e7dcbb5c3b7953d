"""Command line of `captain-asn1`: messages of the standards as code. Without arguments, a menu."""

import argparse
import sys
from pathlib import Path

from asn1 import library, output, selection
from asn1.cpython.build import BuildError
from asn1.importer.fault import ImportFault, MissingError

PROGRAM = "captain-asn1"
FAILED, USAGE = 1, 2
SCHEMA = Path(__file__).parent / "schema"


def main(argv: list[str] | None = None) -> int:
    """Run one command. Returns 0 done, 1 failed, 2 wrong usage. Raises KeyboardInterrupt."""
    argv = sys.argv[1:] if argv is None else argv
    try:
        if not argv and sys.stdin.isatty():
            from asn1 import menu

            return menu.run(lambda line: run(arguments().parse_args(line)))
        return run(arguments().parse_args(argv))
    except BrokenPipeError:
        sys.stderr.close()  # the reader left: nothing to say
        return 0


def run(args: argparse.Namespace) -> int:
    """Run a parsed command; what a user can put right is one line on stderr."""
    from asn1 import commands

    try:
        return commands.COMMANDS[args.command](args)
    except (selection.UnknownMessageError, commands.UsageError) as error:
        return _fail(str(error), USAGE)
    except (output.NotOursError, ImportFault, MissingError, BuildError, commands.CommandError) as error:
        return _fail(str(error))
    except BrokenPipeError:
        raise
    except OSError as error:
        return _fail(f"{error.filename or 'input/output'}: {error.strerror}")


def arguments() -> argparse.ArgumentParser:
    """The flags; the menu asks for the same."""
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description="Messages of the ITS standards as code. Without arguments on a terminal: a menu.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    one = commands.add_parser("list", help="what messages there are")
    one.add_argument("--json", action="store_true", help="as JSON, one object a line")

    _with(one)

    one = commands.add_parser("generate", help="code, pages or ASN.1 text of one, some or all messages")
    one.add_argument("messages", nargs="*", metavar="MESSAGE", help="cam-1.4.1, cam (its preferred edition), 'cam-*'")
    one.add_argument("--standard", action="store_true", help="every message but the experimental ones")
    one.add_argument("--all", action="store_true", help="every message")
    one.add_argument("--form", choices=library.FORMS, default="cmake", help="default: %(default)s")
    one.add_argument("--to", type=Path, required=True, metavar="DIR", help="empty, new, or made by this program before")
    one.add_argument("--profile", choices=library.PROFILES,
                     help="of the form ros2: whose names the messages have; default: etsi_its")  # fmt: skip
    one.add_argument("--ros2", action="store_true",
                     help="of the forms with code: also to serialised ROS 2 messages and back")  # fmt: skip
    one.add_argument("--distro", choices=library.DISTROS,
                     help="of the form ros2: which ROS the Debian packages are for; default: jazzy")  # fmt: skip

    _with(one)

    one = commands.add_parser("import", help="the modules of the standards into the schema of this project")
    one.add_argument("folder", type=Path, metavar="DIR", help="with the modules, or a list of their addresses")

    one = commands.add_parser("import-check", help="whether an import gives the schema and codecs that are here")
    one.add_argument("folder", type=Path, metavar="DIR")

    one = commands.add_parser("add", help="a message of your own, from its ASN.1 files")
    one.add_argument(
        "file", type=Path, nargs="+", metavar="FILE.asn", help="several: modules that import from each other"
    )
    one.add_argument("--pdu", required=True, metavar="TYPE", help="the top-level type in one of the files")
    one.add_argument("--name", required=True, metavar="NAME", help="what it is called: my-msg")
    one.add_argument("--id", type=int, required=True, metavar="N", help="messageID, 0..255")
    one.add_argument("--port", type=int, required=True, metavar="P", help="BTP port, 0..65535")
    one.add_argument(
        "--versions", type=int, nargs="+", default=[1, 2], metavar="V", help="protocolVersion, 0..255; default: 1 2"
    )
    one.add_argument("--replace", action="store_true", help="a message of your own that has this name")
    one.add_argument(
        "--to", type=Path, default=SCHEMA, metavar="DIR", help="where its schema goes; default: %(default)s"
    )

    one = commands.add_parser("remove", help="a message of your own, added before")
    one.add_argument("name", metavar="NAME", help="what it is called")
    one.add_argument("--to", type=Path, default=SCHEMA, metavar="DIR", help="where its schema is; default: %(default)s")
    return parser


def _with(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--with", dest="with_", type=Path, action="append", default=[], metavar="DIR",
                        help="messages of your own that were added to another directory")  # fmt: skip


def _fail(text: str, status: int = FAILED) -> int:
    first, *more = text.splitlines() or [""]
    print(f"{PROGRAM}: {first}", *(f"  {line}" for line in more), sep="\n", file=sys.stderr)
    return status
