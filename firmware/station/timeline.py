"""Time line of a station's start: events of its parts, with their times."""

from collections.abc import Callable

MOST = 64  # largest number of notes; a start with four slots has about thirty


class Timeline:
    """Notes of the start. Only the first MOST are kept, because the journal has them all."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._began = clock()
        self._notes: list[tuple[float, str, str]] = []

    def note(self, who: str, what: str) -> None:
        if len(self._notes) < MOST:
            self._notes.append((round(self._clock() - self._began, 3), who, what))

    def status(self) -> list[dict[str, object]]:
        """Return the notes for JSON: seconds since the start, name of the part, text."""
        return [{"at_s": at_s, "who": who, "what": what} for at_s, who, what in self._notes]
