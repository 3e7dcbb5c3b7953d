"""Words of a slot's life: the states it is in, and what happens to it; the rules that join them are in slots.py."""

import logging
from enum import StrEnum

from board.slot import State as Sequence


class State(StrEnum):
    """Of a slot, as in the status."""

    STOPPED = "stopped"  # the station has not started, or is ending
    UNUSED = "unused"  # no interface has it, its power is left as it was found
    OFF = "off"  # an operator has switched it off
    POWERING = "powering"  # power is on, its device is waited for
    STARTING = "starting"  # its device is there, its driver is being started, if need be again and again
    RUNNING = "running"
    CYCLING = "cycling"  # without power for a moment
    EMPTY = "empty"  # it has power, no interface and no device: one that is plugged in is seen
    FAULT = "fault"


class Event(StrEnum):
    """What happens to a slot."""

    START = "the station has started"
    ON = "switched on"
    OFF = "switched off"
    CYCLE = "power cycle"
    PLUGGED = "device seen"
    UNPLUGGED = "device gone"
    ABSENT = "no device"  # in time, or it went too often
    VACANT = "nothing was plugged in"  # where nobody misses it: no interface has the slot
    SUPPLIED = "power is on"
    RELEASED = "out of reset"
    UNSUPPLIED = "power is off"  # as it was asked for
    UNSWITCHED = "its power could not be switched"
    STARTED = "driver started"
    FAILED = "driver failed"
    STUCK = "driver failed too often, or for good"
    EXHAUSTED = "power cycles do not help"  # in place of ABSENT and STUCK
    STEADY = "ran steadily"


# What a state of the sequencer means here.
MEANINGS = {
    Sequence.POWERED: Event.SUPPLIED,
    Sequence.RELEASED: Event.UNPLUGGED,
    Sequence.PRESENT: Event.PLUGGED,
    Sequence.FAULT: Event.ABSENT,
}
OPERATED = {"on": Event.ON, "off": Event.OFF, "cycle": Event.CYCLE}

# What a power cycle may help against, and what keeps it from one.
FAULTS = (Event.ABSENT, Event.STUCK, Event.UNSWITCHED)

# Of a driver that starts again the interface's own supervisor has said why.
LEVELS = {State.STARTING: logging.DEBUG, State.CYCLING: logging.WARNING, State.FAULT: logging.ERROR}
