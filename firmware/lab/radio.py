"""The simulated radios of two stations: each hears the other, and the recorder hears both."""

from collections.abc import Mapping

from board.address import Address
from board.free_udp import free_udp
from drivers.sim.radio import VARIABLE, Control, library_path
from firmware.user.untrusted import listed, text

BOARD = '[interfaces.air]\ndriver = "som301e"\nlibrary = "{library}"\n'


class Radio:
    """One station's: its board file, what its environment has to say, and what its air has lost."""

    def __init__(self, own: Address, control: Address, peers: str, loss: float, number: int, more: str) -> None:
        self.board = BOARD.format(library=library_path())
        mac = f"02:00:00:00:30:{number:02x}"
        words = f"listen={own} control={control} peers={peers} loss={loss:g} seed={number} mac={mac} {more}"
        self.environment: Mapping[str, str] = {VARIABLE: words}
        self._control = Control(control)

    def say(self, words: str) -> None:
        """Change settings (drivers/sim/radio/settings.h); they hold when this returns."""
        self._control.ask(words)

    def lost(self) -> int:
        """Messages that the air took from this one, and those that were too weak."""
        counters = self._control.ask()
        return counters["lost"] + counters["faded"]


def pair(host: str, recorder: int, loss: float, more: str = "") -> list[Radio]:
    """Two of them; more are words for both. Raises StationError where the library is not built.

    The recorder hears each message before the other radio: what a station has received is in the capture.
    """
    heard_by = Address(host, recorder)
    a, b, *controls = free_udp(host, 4)
    return [
        Radio(own, control, f"{heard_by},{other}", loss, number, more)
        for number, (own, other, control) in enumerate(((a, b, controls[0]), (b, a, controls[1])), 1)
    ]


def is_complete(details: Mapping[str, object]) -> bool:
    """Whether each caster that status shows works: the link is up from the first on."""
    casters = listed(details, "casters")
    return bool(casters) and all(text(row, way) == "up" for row in casters for way in ("rx", "tx"))
