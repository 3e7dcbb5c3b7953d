"""Troubles of pulses, receiver and clock in a day, with durations."""

from enum import StrEnum
from typing import NamedTuple


class Kind(StrEnum):
    """A fault; `amount` of a Trouble means what is said here."""

    # the pulses
    MISSED = "missed"  # the kernel counts an edge and nobody takes it; amount: how many of them
    NOISE = "noise"  # further edges, anywhere; amount: how many a second on average
    BOUNCE = "bounce"  # another edge up to 300 us after each; before it where amount is negative
    TRAILING = "trailing"  # the edge at the end of each pulse as well, 100 ms later
    # the receiver
    LOSS = "loss"  # no satellites: no pulses, and its clock runs free
    RESTART = "restart"  # 3 s of silence, 8 s without a fix, and leap seconds that are its firmware's guess
    VAGUE = "vague"  # what accuracy it claims; amount: ns
    MARK = "mark"  # TIM-TP says another second; amount: s
    EPOCH = "epoch"  # NAV-PVT says another second
    BOTH = "both"  # they agree on it
    LATE = "late"  # amount: s that its words are late by, each by something up to that
    # the machine
    STALL = "stall"  # the loop stands still
    STEP = "step"  # the system's clock is set, anywhere within the second; amount: by how many s
    SLEW = "slew"  # it is slewed; amount: ppb


# In which nobody can ask for a pulse to be passed on.
HARMFUL = frozenset(
    {Kind.LOSS, Kind.RESTART, Kind.VAGUE, Kind.MARK, Kind.EPOCH, Kind.BOTH, Kind.LATE, Kind.STALL, Kind.MISSED}
)


class Trouble(NamedTuple):
    """From a second of the day on, for so many."""

    at: int
    seconds: int
    kind: Kind
    amount: float = 0.0

    @property
    def end(self) -> int:
        return self.at + self.seconds
