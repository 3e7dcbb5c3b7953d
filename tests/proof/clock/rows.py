"""Rows of results, beside the expected values."""

from typing import NamedTuple


class Row(NamedTuple):
    """A figure. trouble: why it misses its goal; empty where it does not."""

    what: str
    seen: str
    goal: str
    trouble: str = ""

    @classmethod
    def of(cls, what: str, seen: str, goal: str, is_met: bool) -> "Row":
        return cls(what, seen, goal, "" if is_met else f"{seen}, not {goal}")

    def __str__(self) -> str:
        return f"{'MISSED' if self.trouble else 'ok':6}  {self.what}: {self.seen}  ({self.goal})"
