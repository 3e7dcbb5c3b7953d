"""Splits sections into pages of a screen, with header and footer."""

from collections.abc import Sequence

FEWEST = 3  # least lines of a section at the end of a page; with less room, the section begins on the next page
BESIDE = 3  # lines of a screen beside sections: head, message, keys


def pages(sections: Sequence[Sequence[str]], height: int) -> list[list[str]]:
    """Return the lines of each page, at most `height` per page; at least one page."""
    made: list[list[str]] = [[]]
    for section in sections:
        left = list(section)
        if made[-1] and height - len(made[-1]) < min(FEWEST, len(left)):
            made.append([])
        while left:
            room = height - len(made[-1])
            made[-1] += left[:room]
            left = left[room:]
            if left:
                made.append([])
    return made


def screen(head: str, body: Sequence[str], message: str, keys: str, height: int) -> list[str]:
    """Return `height` lines; the keys are always the last, even if other lines have no room."""
    room = max(0, height - BESIDE)
    lines = [head, *body[:room], *[""] * (room - len(body)), message, keys]
    return lines[-height:] if height < BESIDE else lines
