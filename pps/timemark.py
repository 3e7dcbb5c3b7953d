"""Which second a pulse begins."""

from typing import NamedTuple

from board.time import LeapEvent
from pps.pulse import Pulse


class Second(NamedTuple):
    """A pulse and the second that it begins, beyond doubt.

    its_s         ITS time.
    accuracy_ns   of the receiver's time, as it says itself.
    leap_seconds  GPS time less UTC, s, as the receiver says. leap_event: announced by satellites.
    series        number of the acquisition that it counts from: in one series its_s counts the seconds of raw_ns; a
                  new one may say another second.
    is_stepped    the system's clock was stepped since the Second before this one: the pulse is good by raw_ns, and
                  its system_ns is of the new setting.
    """

    pulse: Pulse
    its_s: int
    accuracy_ns: int
    leap_seconds: int | None
    leap_event: LeapEvent | None
    series: int = 1
    is_stepped: bool = False
