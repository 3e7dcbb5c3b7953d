"""What became of a message on its way between two interfaces."""

from enum import Enum
from typing import NamedTuple

from firmware.meter.event import Received, Sent


class Way(NamedTuple):
    """From an interface of one station to an interface of another, or of the same: a round trip."""

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
    """Of what was sent, or of what was received."""

    ARRIVED = "arrived"
    LOST = "lost"
    LATE = "late"  # it arrived, and was under way for longer than the grace
    UNSEEN = "unseen"  # it did not arrive as far as the meter has heard, and the meter has not heard all
    DUPLICATE = "duplicate"  # received once more than it was sent
    STRANGE = "strange"  # received, and not sent on this way as far as the meter has heard


class Settled(NamedTuple):
    """A fate, and what it was taken for until now, where a late word corrects that.

    copy          of its PDU on this way, from 0 on: the k-th by one way is the k-th by another.
    is_reordered  something that was sent later arrived earlier (RFC 4737 clause 3.3); not told of repeats.
    is_unheard    it was sent in a span of which not all was heard: what is known of such ones is no fair share.
    is_repeat     several copies of its PDU may have been under way: which of them it was is a guess, its delay unknown.
    """

    way: Way
    fate: Fate
    sent: Sent | None
    received: Received | None
    copy: int = 0
    is_reordered: bool = False
    is_repeat: bool = False
    was: Fate | None = None
    is_unheard: bool = False
