"""What is said of an owner's file: in which file and line, what it is, what to do."""

from typing import NamedTuple


class Note(NamedTuple):
    """One line for the owner.

    is_mistake  because of it the set is not accepted; otherwise it is only told.
    """

    is_mistake: bool
    text: str


def mistake(place: str, what: str, remedy: str = "") -> Note:
    """place: file, or file:line."""
    return Note(True, _line(place, what, remedy))


def remark(place: str, what: str, remedy: str = "") -> Note:
    return Note(False, _line(place, what, remedy))


def at(name: str, line: int | None) -> str:
    return f"{name}:{line}" if line else name


def is_refused(notes: list[Note]) -> bool:
    return any(note.is_mistake for note in notes)


def _line(place: str, what: str, remedy: str) -> str:
    told = f"{place}: {what}; {remedy}" if remedy else f"{place}: {what}"
    return " ".join(told.split())
