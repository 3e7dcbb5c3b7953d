"""Rows of results for a card, beside the expected values."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple


class Row(NamedTuple):
    """What was seen beside what is wanted. goal: in words, or the most that seen may be; empty where there is none."""

    what: str
    seen: str
    goal: str
    is_ok: bool

    def __str__(self) -> str:
        return f"{'ok' if self.is_ok else 'MISSED':6}  {self.what:52} {self.seen:40} {self.goal}"


@dataclass(frozen=True)
class Options:
    """Of one run of the parts.

    count     of whatever a part repeats: power cuts, starts; None: its own number.
    is_short  only what a change has to hold before it is accepted.
    """

    count: int | None = None
    is_short: bool = False


def keep(path: Path, part: str, card: str, rows: Sequence[Row], seconds: float) -> None:
    """The rows of a part in the file of all parts, in place of those of its last run."""
    try:
        kept = json.loads(path.read_text())
    except (OSError, ValueError):
        kept = {}
    date = datetime.now(UTC).isoformat(timespec="minutes")
    kept[part] = {
        "date": date,
        "card": card,
        "seconds": round(seconds),
        "rows": [row._asdict() for row in rows],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(f".{part}")
    new.write_text(json.dumps(kept, indent=1) + "\n")
    new.replace(path)
