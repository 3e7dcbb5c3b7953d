"""Command line of `captain-asn1`. Without arguments on a terminal, it shows a menu."""

import argparse
import errno
import sys
from pathlib import Path

from asn1.backends.backend import BackendError
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2.options import DISTROS, PROFILES
from asn1.importer.parser.fault import ImportFault, MissingError
from asn1.model import selection
from asn1.usage import Parser

PROGRAM = "captain-asn1"
FAILED, USAGE = 1, 2
SCHEMA = Path(__file__).parent / "schema"
REMEDIES = {
    errno.ENOENT: "name an existing file or directory",
    errno.EISDIR: "name a file",
    errno.ENOTDIR: "name a directory",
    errno.EACCES: "check its permissions",
    errno.EROFS: "choose a directory that is not read-only",
    errno.ENOSPC: "free some space",
}


def main(argv: list[str] | None = None) -> int:
    """Run one command. Returns the exit status: 0 done, 1 failed, 2 wrong usage. Raises KeyboardInterrupt on Ctrl-C."""
    argv = sys.argv[1:] if argv is None else argv
    try:
        if not argv and sys.stdin.isatty():
            from asn1 import menu

            return menu.run(lambda line: run(arguments().parse_args(line)))
        return run(arguments().parse_args(argv))
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the pipe has closed it; this suppresses a second error at exit
        return 0


def run(args: argparse.Namespace) -> int:
    """Run a parsed command. Errors of the user are printed on stderr in one line each."""
    from asn1 import commands

    try:
        return commands.COMMANDS[args.command](args)
    except (selection.UnknownMessageError, commands.UsageError) as error:
        return _fail(str(error), USAGE)
    except (BackendError, ImportFault, MissingError, commands.CommandError) as error:
        return _fail(str(error))
    except BrokenPipeError:
        raise
    except OSError as error:
        remedy = REMEDIES.get(error.errno or 0, "check the file and its device")
        return _fail(f"{error.filename or 'input/output'}: {error.strerror}; {remedy}")


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line. The menu builds the same arguments."""
    parser = Parser(
        prog=PROGRAM,
        description="Generates code from the ASN.1 of the ITS messages. Without arguments on a terminal: a menu.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    one = commands.add_parser("list", help="print all messages, the preferred edition of each type first")
    one.add_argument("--json", action="store_true", help="one JSON object per line")

    _with(one)

    one = commands.add_parser("generate", help="write code, pages or ASN.1 text of messages")
    one.add_argument("messages", nargs="*", metavar="MESSAGE", help="cam-1.4.1, cam (its preferred edition), 'cam-*'")
    one.add_argument("--standard", action="store_true", help="every message but the experimental ones")
    one.add_argument("--all", action="store_true", help="every message")
    one.add_argument("--format", dest="form", choices=BACKENDS, default="cmake", metavar="FORMAT",
                     help=f"format of the output: {', '.join(BACKENDS)} (default: %(default)s)")  # fmt: skip
    # Its former name.
    one.add_argument("--form", choices=BACKENDS, default=argparse.SUPPRESS, help=argparse.SUPPRESS)
    one.add_argument(
        "--to", type=Path, required=True, metavar="DIR", help="folder: new, empty, or written by this program"
    )
    one.add_argument("--profile", choices=PROFILES,
                     help="names of the ROS 2 messages, with --format ros2 (default: etsi_its)")  # fmt: skip
    one.add_argument("--ros2", action="store_true",
                     help="add conversion to and from serialised ROS 2 messages, with a format of code")  # fmt: skip
    one.add_argument("--distro", choices=DISTROS,
                     help="ROS of the Debian packages, with --format ros2 (default: jazzy)")  # fmt: skip

    _with(one)

    one = commands.add_parser("import", help="import the modules of the standards into the schema")
    one.add_argument("folder", type=Path, metavar="DIR", help="folder with the modules, or a list of their addresses")

    one = commands.add_parser("import-check", help="check that an import gives the committed schema and codecs")
    one.add_argument("folder", type=Path, metavar="DIR", help="folder with the modules")

    one = commands.add_parser("add", help="add a message of your own from its ASN.1 files")
    one.add_argument("file", type=Path, nargs="+", metavar="FILE.asn", help="ASN.1 file; give all files of the message")
    one.add_argument("--pdu", required=True, metavar="TYPE", help="top-level type of the message, in one of the files")
    one.add_argument("--name", required=True, metavar="NAME", help="name of the message, such as my-msg")
    one.add_argument("--id", type=int, required=True, metavar="N", help="messageID, 0 to 255")
    one.add_argument("--port", type=int, required=True, metavar="P", help="BTP port, 0 to 65535")
    one.add_argument(
        "--versions", type=int, nargs="+", default=[1, 2], metavar="V", help="protocolVersion, 0 to 255 (default: 1 2)"
    )
    one.add_argument("--traffic-class", type=int, metavar="N", default=2,
                     help="traffic class at the station, 0 to 255 (default: %(default)s, as CAM)")  # fmt: skip
    one.add_argument("--priority", type=int, metavar="N", default=3,
                     help="priority at the station, 0 (first) to 7 (default: %(default)s; CAM has 2)")  # fmt: skip
    one.add_argument("--lifetime", type=float, metavar="S", default=1.0,
                     help="lifetime at the station and in the packet, in seconds (default: %(default)g)")  # fmt: skip
    one.add_argument("--replace", action="store_true", help="replace your message of this name")
    one.add_argument(
        "--to", type=Path, default=SCHEMA, metavar="DIR", help="folder for its schema (default: %(default)s)"
    )

    one = commands.add_parser("remove", help="remove a message of your own")
    one.add_argument("name", metavar="NAME", help="name of the message")
    one.add_argument("--to", type=Path, default=SCHEMA, metavar="DIR", help="its folder (default: %(default)s)")
    return parser


def _with(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--with", dest="with_", type=Path, action="append", default=[], metavar="DIR",
                        help="folder with messages that `add --to DIR` has added")  # fmt: skip


def _fail(text: str, status: int = FAILED) -> int:
    first, *more = text.splitlines() or [""]
    print(f"{PROGRAM}: {first}", *(f"  {line}" for line in more), sep="\n", file=sys.stderr)
    return status
