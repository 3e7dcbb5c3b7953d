"""Fate of a message between two interfaces."""

from enum import Enum
from typing import NamedTuple

from firmware.meter.event import ReceivedEvent, Sent


class Way(NamedTuple):
    """Direction from an interface of one station to one of another, or of the same for a round trip."""

    sender: str
    out: str
    receiver: str
    into: str

    def __str__(self) -> str:
        names = self.out if self.out == self.into else f"{self.out} > {self.into}"
        return f"{self.sender} > {self.receiver} {names}"

    @property
    def is_round_trip(self) -> bool:
        return self.sender == self.receiver


class Fate(Enum):
    """Fate of a sent or received message."""

    ARRIVED = "arrived"
    LOST = "lost"
    LATE = "late"  # arrived after a delay longer than the grace time
    UNSEEN = "unseen"  # no reception was reported to the meter, but the meter has missed reports
    DUPLICATE = "duplicate"  # received more often than it was sent
    STRANGE = "strange"  # received without a report that any station sent this message in this direction


class Settled(NamedTuple):
    """Fate of a message in one direction; `was`: its earlier fate, if a late report corrects it.

    copy          number of this copy of its PDU in this direction, from 0. Copies with equal numbers in other
                  directions belong to the same sending.
    is_reordered  a message sent later arrived earlier (RFC 4737 clause 3.3); never set for repeats.
    is_repeat     several copies of its PDU may have been under way, so that the matched copy is a guess and its delay
                  is unknown.
    is_unheard    it was sent in a span with missed reports; such messages do not count in the share of losses.
    """

    way: Way
    fate: Fate
    sent: Sent | None
    received: ReceivedEvent | None
    copy: int = 0
    is_reordered: bool = False
    is_repeat: bool = False
    was: Fate | None = None
    is_unheard: bool = False
