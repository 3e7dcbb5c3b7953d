"""Sections to pages of a screen, and the lines around them."""

from collections.abc import Sequence

FEWEST = 3  # lines of a section that begin it on a page: fewer are left to the next
BESIDE = 3  # lines of a screen that are no section's: the head, a message, the keys


def pages(sections: Sequence[Sequence[str]], height: int) -> list[list[str]]:
    """The lines of each page, at most `height`; one page at least."""
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
    """`height` lines: the keys are always the last, whatever there is room for."""
    room = max(0, height - BESIDE)
    lines = [head, *body[:room], *[""] * (room - len(body)), message, keys]
    return lines[-height:] if height < BESIDE else lines
