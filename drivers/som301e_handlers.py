"""What is known of the handlers of a SOM301-E: whether its link is up, and what status shows of each.

Handler is the vendor's word: what its library gives for one direction of a caster.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from board.describe import Range
from drivers.wire.v2xcast import RX, TX

MODES = {"rx": (RX,), "tx": (TX,), "both": (RX, TX)}
WORDS = {RX: "rx", TX: "tx"}


@dataclass(frozen=True)
class Caster:
    """A service in the profile that was uploaded to the module.

    caster_id  its "ID" there.
    btp_port   what is sent to this BTP port goes there, and what comes from there is taken as of this port.
    mode       which handlers it gets: rx, tx or both. A module may have few.
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
    """As host.link has it."""

    is_up: bool
    why: str


class Handlers:
    """Why each handler does not work: nothing when it does, None while nobody has said."""

    def __init__(self, casters: Sequence[Caster], ip: str) -> None:
        self._casters = casters
        self._ip = ip
        self._why_not: dict[tuple[int, int], str | None] = {
            (place, mode): None for place, caster in enumerate(casters) for mode in MODES[caster.mode]
        }

    def set(self, place: int, mode: int, why_not: str) -> None:
        self._why_not[place, mode] = why_not

    def link(self) -> Link | None:
        """Up when one handler works; None while that is open.

        The text says only what stays the same while one handler after the other changes.
        """
        whys = self._why_not.values()
        failing = next(filter(None, whys), "")
        is_open = None in whys
        if "" in whys:
            partly = f", but not for every caster: {failing}" if failing and not is_open else ""
            return Link(True, f"module {self._ip} answers{partly}")
        return None if is_open else Link(False, f"module {self._ip} does not answer: {failing}")

    def details(self) -> list[dict[str, object]]:
        """A row for each caster, as JSON."""
        return [
            {
                "caster_id": caster.caster_id,
                "btp_port": caster.btp_port,
                **{WORDS[mode]: _word(self._why_not[place, mode]) for mode in MODES[caster.mode]},
            }
            for place, caster in enumerate(self._casters)
        ]


def _word(why_not: str | None) -> str:
    return "starting" if why_not is None else why_not or "up"
