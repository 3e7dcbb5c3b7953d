"""Errors of an import, with file, line and clause; all are reported together."""

from typing import NamedTuple


class Place(NamedTuple):
    """Line of a file, counted from 1."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


class Problem(NamedTuple):
    """An error in a module. clause: of the standard ("X.680 51.9"); "" if the text is simply malformed."""

    place: Place
    text: str
    clause: str = ""

    def __str__(self) -> str:
        return f"{self.place}: {self.text}" + (f" ({self.clause})" if self.clause else "")


class ImportFault(ValueError):  # noqa: N818
    """One or more errors of the modules, sorted by file and line."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = sorted(set(problems))
        super().__init__("\n".join(str(problem) for problem in self.problems))


class MissingError(RuntimeError):
    """A package that the import needs is not installed; str() gives the remedy."""


def fault(place: Place, text: str, clause: str = "") -> ImportFault:
    """Return an ImportFault with one problem."""
    return ImportFault([Problem(place, text, clause)])
