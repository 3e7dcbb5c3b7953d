"""Markdown of a reference page: headings, their anchors, tables and a table of contents."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from tests.documents import anchor

NOTE = "Written by `make reference` from the code. To change a text, change it there."


LOWER = re.compile(r"[a-z][a-z'-]*")  # a word, and no name such as itsGnIsMobile


class MissingError(Exception):
    """Parts of the code without a meaning: a line for each, with its place."""


class Section(NamedTuple):
    """A heading and what is below it, as Markdown.

    level  of the heading: 2 to 4.
    """

    title: str
    body: str
    level: int = 2


@dataclass
class Page:
    """A page of the reference.

    name      of its file, without .md.
    contents  deepest level of headings that the table of contents lists.
    missing   places in the code without a meaning.
    """

    name: str
    title: str
    summary: str
    sections: list[Section]
    contents: int = 3
    missing: list[str] = field(default_factory=list)

    def text(self) -> str:
        """Return the page. Raises MissingError where the code has no meaning for something."""
        if self.missing:
            raise MissingError("\n".join(self.missing))
        listed = [one for one in self.sections if one.level <= self.contents]
        rows = [f"{'  ' * (one.level - 2)}- [{one.title}](#{anchor(one.title)})" for one in listed]
        parts = [f"# {self.title}", self.summary, NOTE, "\n".join(rows)]
        for one in self.sections:
            parts += [f"{'#' * one.level} {one.title}", one.body.strip()]
        return "\n\n".join(filter(None, parts)) + "\n"


def table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; columns that are empty in every row are left out."""
    lines = [tuple(map(_cell, row)) for row in rows]
    used = [at for at in range(len(titles)) if any(line[at] for line in lines)]
    shown = [titles, ["---"] * len(titles), *lines]
    return "\n".join("| " + " | ".join(line[at] for at in used) + " |" for line in shown)


def sentence(text: str) -> str:
    """Return a meaning as a sentence: with a capital, unless it begins with code or a name, and a full stop."""
    first = text.split(" ", 1)[0].rstrip(",;:.")
    if LOWER.fullmatch(first):
        text = text[0].upper() + text[1:]
    return text if not text or text.endswith(".") else f"{text}."


def _cell(text: str) -> str:
    """A bar ends a cell, and what looks like a tag of HTML is not shown."""
    text = re.sub(r"\s+", " ", text).strip().replace("|", "\\|")
    return "".join(
        part if at % 2 else part.replace("<", "&lt;") for at, part in enumerate(re.split(r"(`[^`]*`)", text))
    )
