"""What the service manager says of the station, for when the station itself says nothing."""

from collections.abc import Callable, Sequence

from board.errors import StationError
from board.loop import Loop
from board.tool import Tool
from firmware.user import systemd

LIMIT_S = 5.0
BY_HAND = "it is started by `captain run`"


class Service:
    """words       what became of the station, or who starts it.
    last_words  its own, of why it has ended.
    remedy      what whoever reads this can do.
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
        """Ask, unless it is being asked; where there is no service manager nobody is."""
        if self._tool is None and systemd.MANAGER.exists():
            self._ask(systemd.SHOW, self._shown)

    def leave(self) -> None:
        if self._tool is not None:
            self._tool.leave()

    def _ask(self, command: Sequence[str], said: Callable[[int | None, str], None]) -> None:
        try:
            self._tool = Tool(self._loop, command, LIMIT_S, said, quick=True)
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
