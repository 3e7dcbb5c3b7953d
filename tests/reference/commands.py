"""Page of commands: the help of `captain` and `captain-asn1`, alike with every version of argparse."""

import argparse
import os
import textwrap
from collections.abc import Iterator
from pathlib import Path

from asn1.cli import arguments as asn1_arguments
from firmware.cli import VERBS
from image.manual.files import parsers
from image.manual.page import expanded, invocation
from tests.documents import anchor
from tests.reference.page import Page, Section, table

ROOT = Path(__file__).resolve().parents[2]
WIDTH, COLUMN = 80, 24
SUMMARY = "Help of every command, as `captain COMMAND --help` and `captain-asn1 COMMAND --help` print it."


def page() -> Page:
    made = Page("commands", "Commands", SUMMARY, [], contents=2)
    rows = [(f"[`captain {verb}`](#{anchor(f'captain {verb}')})", text) for verb, text in VERBS.items()]
    made.sections.append(Section("captain", table(("command", "purpose"), rows)))
    for parser in parsers()[1].values():
        made.sections += _sections(parser, made.missing)
    made.sections += _sections(asn1_arguments(), made.missing)
    return made


def _sections(parser: argparse.ArgumentParser, missing: list[str]) -> Iterator[Section]:
    """The section of a parser, and of each of its subcommands."""
    depth = parser.prog.count(" ") if parser.prog.startswith("captain ") else parser.prog.count(" ") + 1
    parts = [(parser.description or "").strip(), *_groups(parser, missing), (parser.epilog or "").strip()]
    text = "\n\n".join(filter(None, parts)).replace(f"{ROOT}{os.sep}", "")
    yield Section(parser.prog, f"```text\n{text}\n```", depth + 1)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield from _sections(one, missing)


def _groups(parser: argparse.ArgumentParser, missing: list[str]) -> Iterator[str]:
    for group in parser._action_groups:
        lines = []
        for action in group._group_actions:
            if action.help is argparse.SUPPRESS or isinstance(action, argparse._HelpAction):
                continue
            if not action.help and not isinstance(action, argparse._SubParsersAction):
                missing.append(f"{parser.prog}: {invocation(action)}: no help")
            lines += _entry(invocation(action), expanded(action))
            if isinstance(action, argparse._SubParsersAction):
                for choice in action._choices_actions:
                    lines += _entry(f"  {choice.dest}", choice.help or "")
        if lines:
            yield "\n".join([f"{group.title}:", *lines])


def _entry(name: str, text: str) -> list[str]:
    """An argument and its help, as argparse lays them out."""
    text = text.replace(f"{ROOT}{os.sep}", "")  # first, else the place of this checkout decides where lines end
    lines = textwrap.wrap(" ".join(text.split()), WIDTH - COLUMN, break_on_hyphens=False) or [""]
    if len(name) > COLUMN - 4:
        return [f"  {name}", *(f"{'':{COLUMN}}{line}".rstrip() for line in lines)]
    first, *more = lines
    return [f"  {name:{COLUMN - 2}}{first}".rstrip(), *(f"{'':{COLUMN}}{line}" for line in more)]
