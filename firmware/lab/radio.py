"""Simulated radios of two stations: each hears the other, the recorder hears both."""

from collections.abc import Mapping

from board.runtime.address import Address
from board.runtime.free_udp import free_udp
from drivers.sim.radio.control import VARIABLE, Control, library_path
from firmware.untrusted import listed, text

BOARD = '[interfaces.air]\ndriver = "som301e"\nlibrary = "{library}"\n'


class Radio:
    """Simulated radio of one station: its board file, environment variables and lost messages."""

    def __init__(self, own: Address, control: Address, peers: str, loss: float, number: int, more: str) -> None:
        self.board = BOARD.format(library=library_path())
        mac = f"02:00:00:00:30:{number:02x}"
        words = f"listen={own} control={control} peers={peers} loss={loss:g} seed={number} mac={mac} {more}"
        self.environment: Mapping[str, str] = {VARIABLE: words}
        self._control = Control(control)

    def say(self, words: str) -> None:
        """Change settings of the radio (drivers/sim/radio/settings.h); they are in effect on return."""
        self._control.ask(words)

    def lost(self) -> int:
        """Return the number of this station's messages that the air lost or that were too weak."""
        counters = self._control.ask()
        return counters["lost"] + counters["faded"]


def pair(host: str, recorder: int, loss: float, more: str = "") -> list[Radio]:
    """Return the simulated radios of two stations.

    more  settings of both.

    The recorder hears each message before the other radio: every message that a station receives is in the capture.
    Raises StationError if the library is not built.
    """
    heard_by = Address(host, recorder)
    a, b, *controls = free_udp(host, 4)
    return [
        Radio(own, control, f"{heard_by},{other}", loss, number, more)
        for number, (own, other, control) in enumerate(((a, b, controls[0]), (b, a, controls[1])), 1)
    ]


def is_complete(details: Mapping[str, object]) -> bool:
    """Whether the status shows all casters working; the link itself is up after the first one."""
    casters = listed(details, "casters")
    return bool(casters) and all(text(row, way) == "up" for row in casters for way in ("rx", "tx"))
