"""What a part of the bench found: one line each, with what was wanted."""

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
