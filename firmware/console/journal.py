"""What went wrong of late, in the words of the system's journal."""

import json
import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

from board.errors import StationError
from board.loop import Loop
from board.tool import Tool

LIMIT_S = 5.0  # for journalctl, which takes 0.1 s
MOST = 8
COMMAND = (
    "journalctl",
    "--quiet",
    "--no-pager",
    "--boot",
    "--reverse",  # of more than the tool's output holds the oldest is lost
    "--lines=150",
    "--output=json",
    "--output-fields=MESSAGE,PRIORITY,SYSLOG_IDENTIFIER",
)
UNREAD = "the journal cannot be read: its group is systemd-journal"
ERROR = 3  # syslog(3)
# The station's own lines come by stderr, all with one priority; what it thinks of them stands in them.
OURS = re.compile(r"[\w.]+: (WARNING|ERROR|CRITICAL): ")


class Trouble(NamedTuple):
    """A line: Unix time, who said it, what."""

    time: float
    who: str
    text: str


class Journal:
    """The last errors, of the station also warnings, asked for again by look().

    troubles  the newest first; changed() is called when they have been read.
    why       they are not known, or empty.
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
        """Ask, unless it is being asked."""
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
    """Of a line of JSON for each entry; what comes again and again is told once, the newest."""
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
        # A message that is no text is a list of octets, or null where it is too long.
        if isinstance(message, str) and (priority <= ERROR or OURS.match(message)):
            yield Trouble(time, who if isinstance(who, str) else "", message)
