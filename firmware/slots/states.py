"""States and events of a slot; supervisor.py has the rules."""

import logging
from enum import StrEnum

from board.slot import SequencerState


class SlotState(StrEnum):
    """State of a slot, as in the status."""

    STOPPED = "stopped"  # the station has not started the slot yet, or is stopping
    UNUSED = "unused"  # no interface uses the slot; its power is not changed
    OFF = "off"  # an operator has switched the slot off
    POWERING = "powering"  # the power is on; the slot waits for its device
    STARTING = "starting"  # the device is present; its driver is started, and retried after failures
    RUNNING = "running"
    CYCLING = "cycling"  # the power is off during a power cycle
    EMPTY = "empty"  # the power is on, but the slot has no interface and no device; a plugged device is detected
    FAULT = "fault"


class Event(StrEnum):
    """Event of a slot."""

    START = "the station has started"
    ON = "switched on"
    OFF = "switched off"
    CYCLE = "power cycle"
    PLUGGED = "device seen"
    UNPLUGGED = "device gone"
    ABSENT = "no device"  # the device did not appear in time, or disappeared too often
    VACANT = "no device present"  # the same in a slot without an interface, which needs no device
    SUPPLIED = "power is on"
    RELEASED = "out of reset"
    UNSUPPLIED = "power is off"  # the power was switched off as requested
    UNSWITCHED = "the slot's power could not be switched"
    STARTED = "driver started"
    FAILED = "driver failed"
    STUCK = "driver failed too often, or cannot recover"
    EXHAUSTED = "power cycles without success"  # replaces ABSENT and STUCK
    STEADY = "ran steadily"


# Event of the slot that follows from each state of its sequencer.
MEANINGS = {
    SequencerState.POWERED: Event.SUPPLIED,
    SequencerState.RELEASED: Event.UNPLUGGED,
    SequencerState.PRESENT: Event.PLUGGED,
    SequencerState.FAULT: Event.ABSENT,
}
OPERATED = {"on": Event.ON, "off": Event.OFF, "cycle": Event.CYCLE}

# Events that are the cause of a fault. After ABSENT and STUCK, power cycles are tried first.
FAULTS = (Event.ABSENT, Event.STUCK, Event.UNSWITCHED)

# Log level of each state; INFO for the others. STARTING has DEBUG, because the interface supervisor has already logged
# why the driver restarts.
LEVELS = {SlotState.STARTING: logging.DEBUG, SlotState.CYCLING: logging.WARNING, SlotState.FAULT: logging.ERROR}
