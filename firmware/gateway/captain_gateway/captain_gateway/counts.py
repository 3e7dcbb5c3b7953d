"""What is counted of one handler, and how often a complaint is logged."""

from collections import Counter
from dataclasses import dataclass, field, replace

LONGEST_NAME = 64  # characters; those of messages have ten


@dataclass
class Counts:
    """Of one handler. Those of each part are written by one thread: of receiving by the one that receives."""

    received: int = 0
    published: int = 0
    not_published: Counter[str] = field(default_factory=Counter)
    left_out: int = 0
    doubtful: int = 0  # published, and another edition of the same header reads other values
    why_not_published: str = ""
    taken: int = 0
    sent: int = 0
    not_sent: Counter[str] = field(default_factory=Counter)
    why_not_sent: str = ""
    outcomes: Counter[str] = field(default_factory=Counter)
    why_refused: str = ""

    def now(self) -> "Counts":
        """As they are: a copy, while another thread counts on. dict() of a Counter is one step of the interpreter."""
        counters = {name: Counter(dict(getattr(self, name))) for name in ("not_published", "not_sent", "outcomes")}
        return replace(self, **counters)  # type: ignore[arg-type]


class Tally:
    """Counts by names that others make up: of so many names at most, and of the rest together."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._counts: dict[str, int] = {}

    def count(self, name: str) -> None:
        name = name[:LONGEST_NAME]
        if name not in self._counts and len(self._counts) >= self._most:
            name = "others"
        self._counts[name] = self._counts.get(name, 0) + 1

    def now(self) -> dict[str, int]:
        """As they are: a copy, while another thread counts on."""
        return dict(self._counts)


class Complaints:
    """Lets the same complaint through once in a while, and says how many it has held back."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._said: dict[tuple[str, str], tuple[float, int]] = {}

    def say(self, about: str, cause: str, text: str, now: float) -> str | None:
        """The line to log, or None. about and cause: which complaints are the same; few of either."""
        last, held = self._said.get((about, cause), (None, 0))
        if last is not None and now - last < self.period_s:
            self._said[about, cause] = (last, held + 1)
            return None
        self._said[about, cause] = (now, 0)
        return f"{about}: {text}" + (f" ({held} more like this since)" if held else "")
