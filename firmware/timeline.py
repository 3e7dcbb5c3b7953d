"""The start of a station as a time line: what came up when, and what it waited for."""

from collections.abc import Callable

MOST = 64  # notes: a start of four slots has about thirty


class Timeline:
    """Notes of the start, the first MOST of them; later ones are in the journal."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._began = clock()
        self._notes: list[tuple[float, str, str]] = []

    def note(self, who: str, what: str) -> None:
        if len(self._notes) < MOST:
            self._notes.append((round(self._clock() - self._began, 3), who, what))

    def status(self) -> list[dict[str, object]]:
        """As JSON: seconds since the start, who, what."""
        return [{"at_s": at_s, "who": who, "what": what} for at_s, who, what in self._notes]
