"""Menu of `captain-asn1`: asks for the arguments of a command, in any terminal."""

import shlex
import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from asn1.backends.backend import OwnOption
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2.options import DISTROS, PROFILES
from asn1.model import text

WIDTH = 78  # columns: a terminal of 80 columns, less a margin
Run = Callable[[list[str]], int]
"""Runs a command line without the program's name and returns its exit status."""
Check = Callable[[str], str | None]
"""Returns the error of an answer, or None."""


class Left(Exception):  # noqa: N818 not an error: the user left a question
    """Raised for an empty answer to a question without a default."""


class Option(NamedTuple):
    """A line of a menu: its text, and the command-line words that it adds."""

    text: str
    words: tuple[str, ...]


FIRST = (
    Option("list the messages", ("list",)),
    Option("generate code, pages or ASN.1 text", ("generate",)),
    Option("add a message of your own, from its .asn file", ("add",)),
    Option("remove a message of your own", ("remove",)),
    Option("import the modules of the standards again", ("import",)),
    Option("compare the modules of the standards with the schema here", ("import-check",)),
)
WHICH = (
    Option("the standard set", ("--standard",)),
    Option("all, experimental ones too", ("--all",)),
    Option("some, by name", ()),
)
PROFILE = tuple(Option(text, ("--profile", profile)) for profile, text in PROFILES.items())
DISTRO = tuple(Option(name, ("--distro", name)) for name in DISTROS)
FORM = tuple(Option(backend.summary, ("--format", name)) for name, backend in BACKENDS.items())


def run(run_command: Run) -> int:
    """Ask for a command and run it, until the user leaves. Returns the exit status of the last command."""
    status = 0
    print("Generates code from the ASN.1 of the ITS messages. An empty answer goes back, q ends.")
    while True:
        try:
            words = list(choose("What do you want to do?", FIRST))
        except (Left, EOFError):
            return status
        try:
            line = QUESTIONS[words[0]](words)
        except EOFError:
            return status
        except Left:
            continue
        print(f"\n$ captain-asn1 {shlex.join(line)}")
        try:
            status = run_command(line)
        except SystemExit as error:  # argparse has already printed the error
            status = int(error.code or 0)


def choose(question: str, options: Sequence[Option]) -> tuple[str, ...]:
    """Ask for one of the options by number, and return its words. Raises Left for an empty answer."""
    print(f"\n{question}")
    for number, option in enumerate(options, 1):
        print(f"  {number}  {option.text}")
    while True:
        answer = ask("number")
        if answer.isdecimal() and 1 <= int(answer) <= len(options):
            return options[int(answer) - 1].words
        print(f"  {answer!r}: out of range; 1 to {len(options)}")


def ask(what: str, default: str = "") -> str:
    """Ask for a line of text; an empty answer means the default.

    Raises Left for an empty answer without a default, EOFError for q and at the end of input.
    """
    answer = input(f"{what} [{default}]: " if default else f"{what}: ").strip() or default
    if answer == "q":
        raise EOFError
    if not answer:
        raise Left
    return answer


def ask_for(what: str, wrong: Check, default: str = "") -> str:
    """Ask like `ask`, and repeat the question until `wrong` returns no error."""
    while True:
        answer = ask(what, default)
        reason = wrong(answer)
        if not reason:
            return answer
        print(f"  {reason}")


def ask_yes(what: str) -> bool:
    """Ask a yes-or-no question. Every answer other than y or yes means no. Raises EOFError for q."""
    answer = input(f"{what} [y/N]: ").strip().lower()
    if answer == "q":
        raise EOFError
    return answer in ("y", "yes")


def _plain(words: list[str]) -> list[str]:
    return words


def _generate(words: list[str]) -> list[str]:
    which = list(choose("Which messages?", WHICH))
    if not which:
        print(textwrap.fill("  ".join(text.load_schema().messages), WIDTH))
        which = shlex.split(ask("names, with blanks between (cam, denm-1.3.1, 'cpm-*')"))
    form = choose("Which format?", FORM)
    backend = BACKENDS[form[1]]
    more = [word for option in backend.options for word in OWN_OPTIONS[option]()]
    return [*words, *which, *form, *more, "--to", ask("into which directory", default=backend.default_folder())]


def _ros2() -> tuple[str, ...]:
    return ("--ros2",) if ask_yes("add conversion to serialised ROS 2 messages and back; the gateway needs it") else ()


OWN_OPTIONS: dict[OwnOption, Callable[[], tuple[str, ...]]] = {
    "profile": lambda: choose("Names of the messages?", PROFILE),
    "distro": lambda: choose("For which ROS?", DISTRO),
    "ros2": _ros2,
}


def _add(words: list[str]) -> list[str]:
    files = shlex.split(ask_for("the .asn file, or several with blanks between", _no_files))
    pdu = ask_for("its top-level type", partial(_no_type, [Path(file) for file in files]))
    name = ask_for("name of the message", _no_name, default=pdu.lower())
    more = _replacing(name)
    number = ask_for("its messageID, 0 to 255", partial(_no_number, 255))
    port = ask_for("its BTP port, 0 to 65535", partial(_no_number, 65535))
    return [*words, *files, "--pdu", pdu, "--name", name, "--id", number, "--port", port, *more]


def _replacing(name: str) -> list[str]:
    """Return the option that replaces an existing message, if the user agrees. Raises Left if not."""
    if not (text.SCHEMA / f"{name}.toml").exists():
        return []
    if not ask_yes(f"{name} already exists; replace it?"):
        raise Left
    return ["--replace"]


def _remove(words: list[str]) -> list[str]:
    mine = [one.name for one in text.load_schema().messages.values() if (text.SCHEMA / f"{one.name}.toml").exists()]
    if not mine:
        print("  you have not added a message")
        raise Left
    return [*words, *choose("Which one?", [Option(name, (name,)) for name in mine])]


def _no_files(answer: str) -> str | None:
    try:
        missing = [file for file in shlex.split(answer) if not Path(file).is_file()]
    except ValueError as error:
        return f"{answer}: {error}"
    return f"{missing[0]}: file not found" if missing else None


def _no_type(files: list[Path], answer: str) -> str | None:
    from asn1.own import add

    return add.no_type(files, answer)


def _no_name(answer: str) -> str | None:
    from asn1.own import add

    return add.no_name(answer, text.load_schema())


def _no_number(high: int, answer: str) -> str | None:
    is_one = answer.isdecimal() and int(answer) <= high
    return None if is_one else f"{answer!r}: out of range; 0 to {high}"


def _folder(words: list[str]) -> list[str]:
    return [*words, ask("the directory with the modules")]


QUESTIONS: dict[str, Callable[[list[str]], list[str]]] = {
    "list": _plain,
    "generate": _generate,
    "add": _add,
    "remove": _remove,
    "import": _folder,
    "import-check": _folder,
}
