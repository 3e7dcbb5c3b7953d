"""What the importer says of a text that it cannot take: file, line, construct, clause; all of them at once."""

from typing import NamedTuple


class Place(NamedTuple):
    """A line of a module's file; the first is 1."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


class Problem(NamedTuple):
    """clause: of the standard that the construct is from ("X.680 51.9"), or "" where the text is just wrong."""

    place: Place
    text: str
    clause: str = ""

    def __str__(self) -> str:
        return f"{self.place}: {self.text}" + (f" ({self.clause})" if self.clause else "")


class ImportFault(ValueError):  # noqa: N818
    """One or more problems of the modules, in the order of the files and lines."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = sorted(set(problems))
        super().__init__("\n".join(str(problem) for problem in self.problems))


class MissingError(RuntimeError):
    """A package that reading modules takes is not installed; str() names the remedy."""


def fault(place: Place, text: str, clause: str = "") -> ImportFault:
    """A fault of one problem."""
    return ImportFault([Problem(place, text, clause)])
