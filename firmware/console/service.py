"""Service manager's state of the station's service, for the serial console."""

from collections.abc import Callable, Sequence

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.runtime.tool import Tool
from firmware import systemd

SYSTEMD_S = 5.0  # limit for systemctl and journalctl
BY_HAND = "start it with `captain run`"


class Service:
    """Queries the service manager about the station while the station does not answer.

    words       state of the service, or how to start the station.
    last_words  last error that the station logged before its end.
    remedy      remedy for the reader.
    """

    def __init__(self, loop: Loop, changed: Callable[[], None]) -> None:
        self.words, self.last_words, self.remedy = BY_HAND, "", ""
        self._loop = loop
        self._changed = changed
        self._tool: Tool | None = None

    @property
    def is_read(self) -> bool:
        return self._tool is None

    def look(self) -> None:
        """Start a query, unless one is in progress or the machine has no service manager."""
        if self._tool is None and systemd.MANAGER.exists():
            self._ask(systemd.SHOW, self._shown)

    def leave(self) -> None:
        if self._tool is not None:
            self._tool.leave()

    def _ask(self, command: Sequence[str], said: Callable[[int | None, str], None]) -> None:
        try:
            self._tool = Tool(self._loop, command, SYSTEMD_S, said, quick=True)
        except StationError:
            self._tool = None

    def _shown(self, status: int | None, output: str) -> None:
        self._tool = None
        unit = systemd.read(output)
        self.words, self.remedy = (systemd.state(unit), systemd.remedy(unit)) if unit else (BY_HAND, "")
        if unit:
            self._ask(systemd.SAID, self._said)
        self._changed()

    def _said(self, status: int | None, output: str) -> None:
        self._tool = None
        self.last_words = systemd.last_words(output)
        self._changed()
