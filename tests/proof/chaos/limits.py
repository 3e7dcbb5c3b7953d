"""Within what time a module is back after its trouble has ended: sums of the times that the parts give themselves.

board/README.md has them as figures; test_chaos.py sees that they are these.
"""

from board import board_worker, health
from board.description import Hardware
from board.runtime.child import START_S
from drivers.gnss import bringup, receiver, running
from drivers.sim.modules import MODEM, RADIO, RECEIVER
from drivers.sim.trouble import BOARD
from drivers.sim8202g import recovery, step, watch
from drivers.som301e import handler, process
from drivers.som301e.watchdog import CHECK_S
from drivers.wire.at.forms import command
from firmware.slots import supervisor as slots
from firmware.station import interface_supervisor

RETRY_S = interface_supervisor.MOST_S * (1 + interface_supervisor.JITTER)
ASKED_S = 1.0  # Conversation.ask waits so long for an answer

# What is added where a switch of the slot failed, until it is tried again.
SWITCH_S = slots.RESWITCH_S

# By what belongs in the slot.
MODULES_S = {
    # It is seen; questions are asked in vain as often as they are asked; the next start.
    RECEIVER: receiver.SILENT_S + running.LOOK_S + bringup.IDENTIFY_TRIES * ASKED_S + RETRY_S,
    # A call that hangs is seen; the next start; a process; a handler that just could not be made.
    RADIO: process.CALL_S + CHECK_S + RETRY_S + START_S + handler.LONGEST_DELAY_S,
    # It is seen; the longest command that is left unanswered; the longest pause before a reset; its boot.
    MODEM: watch.SECOND_LOOK_S
    + command("AT+CGATT=0").timeout_s
    + recovery.FIRST_S * 4 * (1 + recovery.JITTER)
    + step.BRING_UP["port"].limit_s,
}

# What does not answer is asked that seldom; the call before it may take its whole time, and cost a process.
BOARD_S = health.LONGEST_S + board_worker.DEADLINE_S + START_S

# That it has to be up before it counts as back: a trouble that ended may be seen this much later.
SETTLE_S = {RECEIVER: 5.0, RADIO: 8.0, MODEM: 30.0, BOARD: 5.0}


def limit_s(hardware: Hardware, name: str) -> float:
    """Of a slot, a power cycle with all the time that its module may take to show itself included; or of the board."""
    if name == BOARD:
        return BOARD_S
    slot = hardware.slots[name]
    return MODULES_S[slot.ids[0]] + slot.off_s + slot.settle_s + slot.wait_s


def settle_s(hardware: Hardware, name: str) -> float:
    return SETTLE_S[name if name == BOARD else hardware.slots[name].ids[0]]
