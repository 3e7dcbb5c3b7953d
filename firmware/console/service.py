"""What the service manager says of the station, for when the station itself says nothing."""

from collections.abc import Callable, Mapping
from pathlib import Path

from board.errors import StationError
from board.loop import Loop
from board.tool import Tool

UNIT = "captain.service"
COMMAND = ("systemctl", "show", UNIT, "--property=LoadState,ActiveState,SubState,Result,NRestarts")
LIMIT_S = 5.0
MANAGER = Path("/run/systemd/system")  # sd_booted(3): is there where systemd runs

BY_HAND = "it is started by `captain run`"
BY_MANAGER = f"it is started by `systemctl start {UNIT}`"


class Service:
    """words  who starts the station, and what became of it."""

    def __init__(self, loop: Loop, changed: Callable[[], None], manager: Path = MANAGER) -> None:
        self.words = BY_HAND
        self._loop = loop
        self._changed = changed
        self._manager = manager
        self._tool: Tool | None = None

    @property
    def is_read(self) -> bool:
        return self._tool is None

    def look(self) -> None:
        """Ask, unless it is being asked; where there is no service manager nobody is."""
        if self._tool is None and self._manager.exists():
            try:
                self._tool = Tool(self._loop, COMMAND, LIMIT_S, self._said, quick=True)
            except StationError:
                self.words = BY_HAND

    def leave(self) -> None:
        if self._tool is not None:
            self._tool.leave()

    def _said(self, status: int | None, output: str) -> None:
        self._tool = None
        self.words = described(dict(line.split("=", 1) for line in output.splitlines() if "=" in line))
        self._changed()


def described(unit: Mapping[str, str]) -> str:
    """The properties of a unit in words."""
    if unit.get("LoadState") != "loaded":
        return BY_HAND
    state, result = unit.get("ActiveState", ""), unit.get("Result", "")
    parts = [f"{UNIT} is {state}" + (f" ({unit['SubState']})" if unit.get("SubState") not in (None, state) else "")]
    if result not in ("", "success"):
        parts.append(f"its last run: {result}")
    if unit.get("NRestarts", "0") != "0":
        parts.append(f"started again {unit['NRestarts']} times")
    return f"{', '.join(parts)}; {BY_MANAGER}"
