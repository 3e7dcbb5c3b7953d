"""Recent errors of the system's journal."""

import json
import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.runtime.tool import Tool

LIMIT_S = 5.0  # limit for journalctl, which takes 0.1 s
MOST = 8
COMMAND = (
    "journalctl",
    "--quiet",
    "--no-pager",
    "--boot",
    "--reverse",  # newest first, because the end is lost if the output exceeds the limit of Tool
    "--lines=150",
    "--output=json",
    "--output-fields=MESSAGE,PRIORITY,SYSLOG_IDENTIFIER",
)
UNREAD = "the journal cannot be read: add the user to group systemd-journal"
ERROR = 3  # syslog(3)
# The station logs to stderr, which gives all lines one priority; the level is in the text.
OURS = re.compile(r"[\w.]+: (WARNING|ERROR|CRITICAL): ")


class Trouble(NamedTuple):
    """Error line of the journal: Unix time, program, message."""

    time: float
    who: str
    text: str


class Journal:
    """Recent errors of all programs, and warnings of the station; look() reads them again.

    troubles  errors, the newest first; changed() is called after each reading.
    why       why they could not be read; else empty.
    """

    def __init__(self, loop: Loop, changed: Callable[[], None]) -> None:
        self.troubles: list[Trouble] = []
        self.why = ""
        self._loop = loop
        self._changed = changed
        self._tool: Tool | None = None

    @property
    def is_read(self) -> bool:
        return self._tool is None

    def look(self) -> None:
        """Start reading, unless a reading is in progress."""
        if self._tool is None:
            try:
                self._tool = Tool(self._loop, COMMAND, LIMIT_S, self._said, quick=True)
            except StationError as error:
                self.troubles, self.why = [], f"the journal cannot be read: {error.message}"

    def leave(self) -> None:
        if self._tool is not None:
            self._tool.leave()

    def _said(self, status: int | None, output: str) -> None:
        self._tool = None
        self.troubles = troubles(output)
        self.why = "" if status == 0 else UNREAD
        self._changed()


def troubles(output: str) -> list[Trouble]:
    """Return the errors in journalctl's JSON lines; of repeated ones only the newest, MOST at most."""
    found: dict[tuple[str, str], Trouble] = {}
    for entry in _entries(output):
        found.setdefault((entry.who, entry.text), entry)
    return list(found.values())[:MOST]


def _entries(output: str) -> Iterator[Trouble]:
    for line in output.splitlines():
        try:
            entry = json.loads(line)
            message, who = entry["MESSAGE"], entry.get("SYSLOG_IDENTIFIER")
            priority, time = int(entry.get("PRIORITY", 6)), int(entry["__REALTIME_TIMESTAMP"]) / 1e6
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            continue
        # A message that is not text is a list of octets, or null if it is too long.
        if isinstance(message, str) and (priority <= ERROR or OURS.match(message)):
            yield Trouble(time, who if isinstance(who, str) else "", message)
