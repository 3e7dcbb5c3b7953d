"""Settings of a machine, and the parts that find and make them."""

from typing import NamedTuple, Protocol


class Setting(NamedTuple):
    """A setting that the machine lacks.

    file    absolute path of its file.
    line    line that the file lacks, or the change in it.
    reason  key of the board file that needs it, or another reason.
    """

    file: str
    line: str
    reason: str

    def __str__(self) -> str:
        return f"{self.file}: {self.line} ({self.reason})"


class Part(Protocol):
    """Settings of one kind."""

    def lacking(self) -> list[Setting]:
        """Return the settings that are not made. Raises StationError if a file cannot be read."""
        ...

    def make(self) -> None:
        """Make them, and keep what they replace. Raises StationError if that fails; the next undo reverts the rest."""
        ...
