"""The same as the flags, asked for: numbered questions and plain input, in any terminal."""

import shlex
import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from asn1 import library, text

WIDTH = 78  # columns of the smallest terminal, and a margin
Run = Callable[[list[str]], int]
"""Runs a command line without the program's name and returns its exit status."""
Check = Callable[[str], str | None]
"""What is wrong with an answer."""


class Left(Exception):  # noqa: N818 no error: the user has had enough of a question
    """An empty answer where there is no default."""


class Option(NamedTuple):
    """A line of a menu: what is shown, and what it stands for."""

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
PROFILE = tuple(Option(text, ("--profile", profile)) for profile, text in library.PROFILES.items())
DISTRO = tuple(Option(name, ("--distro", name)) for name in library.DISTROS)
FORM = tuple(Option(text, ("--form", form)) for form, text in library.FORMS.items())


def run(run_command: Run) -> int:
    """Ask, run, and ask again until the user leaves. Returns the exit status of the last command."""
    status = 0
    print("Messages of the ITS standards as code. An empty answer goes back, q ends.")
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
        except SystemExit as error:  # argparse has said what is wrong
            status = int(error.code or 0)


def choose(question: str, options: Sequence[Option]) -> tuple[str, ...]:
    """One of the options by its number. Raises Left."""
    print(f"\n{question}")
    for number, option in enumerate(options, 1):
        print(f"  {number}  {option.text}")
    while True:
        answer = ask("number")
        if answer.isdecimal() and 1 <= int(answer) <= len(options):
            return options[int(answer) - 1].words
        print(f"  {answer!r} is none of 1 to {len(options)}")


def ask(what: str, default: str = "") -> str:
    """A line of text; an empty one means the default. Raises Left, and EOFError for q and at the end of input."""
    answer = input(f"{what} [{default}]: " if default else f"{what}: ").strip() or default
    if answer == "q":
        raise EOFError
    if not answer:
        raise Left
    return answer


def ask_for(what: str, wrong: Check, default: str = "") -> str:
    """As `ask`, again until nothing is wrong with the answer."""
    while True:
        answer = ask(what, default)
        reason = wrong(answer)
        if not reason:
            return answer
        print(f"  {reason}")


def ask_yes(what: str) -> bool:
    """Whether the answer is yes; anything else is no. Raises EOFError."""
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
    form = choose("In which form?", FORM)
    folder, more = f"build/{form[1]}", []
    if form[1] == "ros2":
        more += [*choose("With whose names?", PROFILE), *choose("For which ROS?", DISTRO)]
        folder = "build/ros2-packages"  # build/ros2 holds the ROS of the tests
    elif form[1] in library.WITH_CODE and ask_yes(
        "to serialised ROS 2 messages and back as well, as its gateway needs"
    ):
        more.append("--ros2")
    return [*words, *which, *form, *more, "--to", ask("into which directory", default=folder)]


def _add(words: list[str]) -> list[str]:
    files = shlex.split(ask_for("the .asn file, or several with blanks between", _no_files))
    pdu = ask_for("its top-level type", partial(_no_type, [Path(file) for file in files]))
    name = ask_for("what the message is to be called", _no_name, default=pdu.lower())
    more = _replacing(name)
    number = ask_for("its messageID, 0..255", partial(_no_number, 255))
    port = ask_for("its BTP port, 0..65535", partial(_no_number, 65535))
    return [*words, *files, "--pdu", pdu, "--name", name, "--id", number, "--port", port, *more]


def _replacing(name: str) -> list[str]:
    """What says that a message of the user's own goes for the new one. Raises Left where it is to stay."""
    if not (text.SCHEMA / f"{name}.toml").exists():
        return []
    if not ask_yes(f"{name} already exists; replace it?"):
        raise Left
    return ["--replace"]


def _remove(words: list[str]) -> list[str]:
    mine = [one.name for one in text.load_schema().messages.values() if (text.SCHEMA / f"{one.name}.toml").exists()]
    if not mine:
        print("  no message of your own is here")
        raise Left
    return [*words, *choose("Which one?", [Option(name, (name,)) for name in mine])]


def _no_files(answer: str) -> str | None:
    try:
        missing = [file for file in shlex.split(answer) if not Path(file).is_file()]
    except ValueError as error:
        return f"{answer}: {error}"
    return f"there is no file {missing[0]}" if missing else None


def _no_type(files: list[Path], answer: str) -> str | None:
    from asn1 import add

    return add.no_type(files, answer)


def _no_name(answer: str) -> str | None:
    from asn1 import add

    return add.no_name(answer, text.load_schema())


def _no_number(high: int, answer: str) -> str | None:
    is_one = answer.isdecimal() and int(answer) <= high
    return None if is_one else f"{answer!r} is no number from 0 to {high}"


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
