"""Rows of results of the bench, beside the expected values."""

from typing import NamedTuple


class Row(NamedTuple):
    """trouble: empty where the goal is met."""

    what: str
    found: str
    trouble: str = ""

    def __str__(self) -> str:
        return f"  {'MISSED' if self.trouble else 'ok':6}  {self.what}: {self.found}" + (
            f" ({self.trouble})" if self.trouble else ""
        )
