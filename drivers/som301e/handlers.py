"""State of the handlers of a SOM301-E: its link, and details for status.

Handler is the vendor's word: its library returns one for each direction of a caster.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from board.runtime.describe import Range
from drivers.wire.v2xcast import RX, TX

MODES = {"rx": (RX,), "tx": (TX,), "both": (RX, TX)}
WORDS = {RX: "rx", TX: "tx"}


@dataclass(frozen=True)
class Caster:
    """A caster: a service of the profile in the module.

    caster_id  "ID" of the service in that profile.
    btp_port   messages to this BTP port use this service; its received messages count as of this port.
    mode       directions in use. A module may have few handlers.
    """

    caster_id: Annotated[int, Range(0, 65535)]
    btp_port: Annotated[int, Range(0, 65535)]
    mode: Literal["rx", "tx", "both"] = "both"

    @property
    def receives(self) -> bool:
        return RX in MODES[self.mode]

    @property
    def transmits(self) -> bool:
        return TX in MODES[self.mode]


class Link(NamedTuple):
    """Arguments of Host.link(): state of the link, and the reason in words."""

    is_up: bool
    why: str


class Handlers:
    """State of each handler: empty text if it works, a reason if it does not, None while unknown."""

    def __init__(self, casters: Sequence[Caster], ip: str) -> None:
        self._casters = casters
        self._ip = ip
        self._why_not: dict[tuple[int, int], str | None] = {
            (index, mode): None for index, caster in enumerate(casters) for mode in MODES[caster.mode]
        }

    def set(self, index: int, mode: int, why_not: str) -> None:
        self._why_not[index, mode] = why_not

    def link(self) -> Link | None:
        """Return the link: up if at least one handler works, down if all fail, None while that is unknown.

        Handlers report one after the other. The text names a failing handler only when all have reported, so that it
        does not change with each report.
        """
        whys = self._why_not.values()
        failing = next(filter(None, whys), "")
        is_open = None in whys
        if "" in whys:
            partly = f", but not for every caster: {failing}" if failing and not is_open else ""
            return Link(True, f"module {self._ip} answers{partly}")
        return None if is_open else Link(False, f"module {self._ip} does not answer: {failing}")

    def details(self) -> list[dict[str, object]]:
        """Return a row of JSON values for each caster: identifier, BTP port, and state of each direction."""
        return [
            {
                "caster_id": caster.caster_id,
                "btp_port": caster.btp_port,
                **{WORDS[mode]: _word(self._why_not[index, mode]) for mode in MODES[caster.mode]},
            }
            for index, caster in enumerate(self._casters)
        ]


def _word(why_not: str | None) -> str:
    return "starting" if why_not is None else why_not or "up"
