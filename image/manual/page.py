"""Man pages in roff: one of a parser, and one that lists all commands."""

import argparse
import re
import textwrap
from collections.abc import Iterator, Mapping
from typing import NamedTuple

# Characters that roff reads as commands, or replaces by typographic ones: an example must survive copying.
_ESCAPES = str.maketrans({"\\": "\\e", "-": "\\-", "'": "\\(aq", "`": "\\(ga", "^": "\\(ha", "~": "\\(ti"})


class Head(NamedTuple):
    """Version of the program, and date of its pages as YYYY-MM-DD."""

    version: str
    date: str


def overview(name: str, summary: str, usage: str, groups: Mapping[str, Mapping[str, str]], head: Head) -> str:
    """Return the page of a program. groups: summaries of its commands, by name, by title of their group."""
    lines = [*_title(name, summary, head), *_synopsis(usage), ".SH COMMANDS"]
    for group, commands in groups.items():
        lines.append(f".SS {_roff(group)}")
        for command, text in commands.items():
            lines += [".TP", f".BR {_roff(f'{name}-{command}')} (1)", _roff(text)]
    return "\n".join(lines) + "\n"


def of(parser: argparse.ArgumentParser, summary: str, head: Head) -> str:
    """Return the page of a command, named after its parser's prog with a hyphen for each blank."""
    name = parser.prog.replace(" ", "-")
    usage = parser.format_usage().removeprefix("usage: ")
    description = [*_text(parser.description or "")][1:]  # without .PP: the heading begins a paragraph
    lines = [*_title(name, summary, head), *_synopsis(usage), ".SH DESCRIPTION", *description]
    for group in parser._action_groups:
        rows = [row for action in group._group_actions if action.help != argparse.SUPPRESS for row in _row(action)]
        lines += [_heading(group.title or ""), *rows] if rows else []
    return "\n".join([*lines, *_text(parser.epilog or ""), ".SH SEE ALSO", ".BR captain (1)"]) + "\n"


def invocation(action: argparse.Action) -> str:
    """Return an argument as a user writes it: its options and the placeholder of its values."""
    value = _value(action)
    if not action.option_strings:
        return value
    return ", ".join(action.option_strings) + (f" {value}" if value else "")


def expanded(action: argparse.Action) -> str:
    """Return the help of an argument, with its default."""
    return argparse.HelpFormatter("")._expand_help(action) if action.help else ""


def _value(action: argparse.Action) -> str:
    """Return the placeholder of an argument's values."""
    if action.nargs == 0:
        return ""
    word = action.metavar or ("{" + ",".join(map(str, action.choices)) + "}" if action.choices else "")
    if not word:
        word = action.dest.upper() if action.option_strings else action.dest
    if isinstance(word, tuple):
        return " ".join(word)
    if isinstance(action.nargs, int):
        return " ".join([word] * action.nargs)
    return {"?": f"[{word}]", "*": f"[{word} ...]", "+": f"{word} ..."}.get(action.nargs or "", word)


def _title(name: str, summary: str, head: Head) -> list[str]:
    title = f'.TH "{_roff(name.upper())}" 1 "{head.date}" "captain {head.version}" "User Commands"'
    return [title, ".SH NAME", f"{_roff(name)} \\- {_roff(summary)}"]


def _synopsis(usage: str) -> list[str]:
    return [".SH SYNOPSIS", _roff(" ".join(usage.split()))]


def _row(action: argparse.Action) -> list[str]:
    return [".TP", f"\\fB{_roff(invocation(action))}\\fR", _roff(" ".join(expanded(action).split()))]


def _text(text: str) -> Iterator[str]:
    """Yield paragraphs: a table keeps its lines, and the line above it becomes a heading."""
    for paragraph in filter(None, re.split(r"\n\s*\n", text.strip("\n"))):
        first, *rest = paragraph.splitlines()
        if rest and first.endswith(":") and rest[0].startswith(" "):
            yield _heading(first[:-1])
            yield from _kept(rest)
        elif any(line.startswith(" ") for line in [first, *rest]):
            yield ".PP"
            yield from _kept([first, *rest])
        else:
            yield ".PP"
            yield _roff(" ".join([first, *rest]))


def _heading(text: str) -> str:
    return f".SH {_roff(text.upper() if text.islower() else text)}"


def _kept(lines: list[str]) -> list[str]:
    return [".nf", *map(_roff, textwrap.dedent("\n".join(lines)).splitlines()), ".fi"]


def _roff(text: str) -> str:
    """Escape a text. A line must not begin with a full stop, which begins a command."""
    escaped = text.translate(_ESCAPES)
    return f"\\&{escaped}" if escaped.startswith(".") else escaped
