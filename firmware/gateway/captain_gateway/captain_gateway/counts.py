"""Counters of one handler, and the rate limit of its log lines."""

from collections import Counter
from dataclasses import dataclass, field, replace

LONGEST_NAME = 64  # characters; names of message types have about ten


@dataclass
class Counts:
    """Counters of one handler. Each is written by one thread only.

    The receiving thread counts received messages and outcomes, the executor's thread messages to send.
    """

    received: int = 0
    published: int = 0
    not_published: Counter[str] = field(default_factory=Counter)
    left_out: int = 0
    doubtful: int = 0  # published, although another edition with the same header decodes to other values
    why_not_published: str = ""
    taken: int = 0
    sent: int = 0
    not_sent: Counter[str] = field(default_factory=Counter)
    why_not_sent: str = ""
    outcomes: Counter[str] = field(default_factory=Counter)
    why_refused: str = ""

    def now(self) -> "Counts":
        """Return a copy while another thread counts on. dict() of a Counter is atomic in CPython."""
        counters = {name: Counter(dict(getattr(self, name))) for name in ("not_published", "not_sent", "outcomes")}
        return replace(self, **counters)  # type: ignore[arg-type]


class Tally:
    """Counters by name, for names chosen by peers. Beyond `most` names the rest are counted as "others"."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._counts: dict[str, int] = {}

    def count(self, name: str) -> None:
        name = name[:LONGEST_NAME]
        if name not in self._counts and len(self._counts) >= self._most:
            name = "others"
        self._counts[name] = self._counts.get(name, 0) + 1

    def now(self) -> dict[str, int]:
        """Return a copy while another thread counts on."""
        return dict(self._counts)


class Complaints:
    """Rate limit of log lines: passes equal complaints once per period, and counts the suppressed ones."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._said: dict[tuple[str, str], tuple[float, int]] = {}

    def say(self, about: str, cause: str, text: str, now: float) -> str | None:
        """Return the line to log, or None if it is suppressed.

        about, cause  complaints with the same pair are equal. Both take few values.
        now           time in seconds, monotonic.
        """
        last, held = self._said.get((about, cause), (None, 0))
        if last is not None and now - last < self.period_s:
            self._said[about, cause] = (last, held + 1)
            return None
        self._said[about, cause] = (now, 0)
        return f"{about}: {text}" + (f" ({held} more like this since)" if held else "")
