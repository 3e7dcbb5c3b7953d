"""Notes for the owner of a card: file, line, fault, remedy."""

from typing import NamedTuple

TOO_DEEP = "is nested too deeply", "check that it is the right file"


class Note(NamedTuple):
    """One line for the owner.

    is_mistake  True: the set is rejected because of it; False: a remark only.
    place       file, or file:line.
    """

    is_mistake: bool
    place: str
    what: str
    remedy: str

    @property
    def text(self) -> str:
        told = f"{self.place}: {self.what}; {self.remedy}" if self.remedy else f"{self.place}: {self.what}"
        return " ".join(told.split())


def mistake(place: str, what: str, remedy: str = "") -> Note:
    return Note(True, place, what, remedy)


def remark(place: str, what: str, remedy: str = "") -> Note:
    return Note(False, place, what, remedy)


def at(name: str, line: int | None) -> str:
    return f"{name}:{line}" if line else name


def is_refused(notes: list[Note]) -> bool:
    return any(note.is_mistake for note in notes)
