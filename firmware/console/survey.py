"""Gathers the console's facts from station, kernel and journal, without blocking."""

import re
import time
from collections.abc import Callable, Sequence

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from firmware.console.addresses import devices, is_open
from firmware.console.asking import Asking, Status
from firmware.console.journal import Journal
from firmware.console.notes import Notes
from firmware.console.rates import Rates
from firmware.console.service import Service
from firmware.console.sheet import Facts

# Shortest time between two queries, whatever keys are pressed; a status takes a station 0.3 ms.
ASKED_S = 1.9
JOURNAL_S = 30.0  # interval of readings, each of which takes 0.1 s of processor time
SERVICE_S = 10.0
FIRST_PORT = 5555  # port of a station whose control socket has no number in its name
NUMBER = re.compile(r"captain-(?:.*-)?(\d{1,5})\.sock$")


class Survey:
    """Facts so far; look() gathers new ones, and changed() is called when some have come.

    paths  candidate control sockets of the station; the first one on which a program listens is used.
    notes  path of the file with notes; empty: none.
    """

    def __init__(self, loop: Loop, paths: Sequence[str], notes: str, changed: Callable[[], None]) -> None:
        self._loop = loop
        self._paths = paths
        self._changed = changed
        self._notes = Notes(notes)
        self._rates = Rates()
        self._journal = Journal(loop, changed)
        self._service = Service(loop, changed)
        self._asking: Asking | None = None
        self._status: Status = {}
        self._why = "the station has not answered yet"
        self._is_known = False
        self._due: dict[str, float] = {}

    @property
    def is_complete(self) -> bool:
        """True if all queries have been answered."""
        return self._is_known and self._asking is None and self._journal.is_read and self._service.is_read

    @property
    def is_answered(self) -> bool:
        """True if a station has answered the last query."""
        return bool(self._status)

    def look(self) -> None:
        """Start all queries whose interval is over."""
        if self._is_due("station", ASKED_S) and self._asking is None:
            self._asking = Asking(self._loop, self._paths, self._told)
        if self._is_due("journal", JOURNAL_S):
            self._journal.look()

    def facts(self) -> Facts:
        """Return all facts; those of the kernel and the notes are read now."""
        self._notes.look()
        return Facts(
            self._status,
            self._why,
            self._service.words,
            self._service.last_words,
            self._service.remedy,
            self._rates.of,
            devices(),
            is_open(_port(self._paths)),
            self._notes.lines,
            self._journal.troubles,
            self._journal.why,
            time.time(),
        )

    def leave(self) -> None:
        """Cancel all queries."""
        if self._asking is not None:
            self._asking.leave()
        self._journal.leave()
        self._service.leave()

    def _told(self, answer: Status | StationError) -> None:
        self._asking = None
        self._is_known = True
        if isinstance(answer, StationError):
            self._status, self._why = {}, answer.message
            if self._is_due("service", SERVICE_S):
                self._service.look()
        else:
            self._status = answer
            self._rates.add(answer, self._loop.clock())
        self._changed()

    def _is_due(self, what: str, every_s: float) -> bool:
        now = self._loop.clock()
        if now < self._due.get(what, now):
            return False
        self._due[what] = now + every_s
        return True


def _port(paths: Sequence[str]) -> int:
    """Return the port to which users publish, from the name of the control socket."""
    found = NUMBER.search(paths[0]) if paths else None
    return int(found[1]) if found else FIRST_PORT
