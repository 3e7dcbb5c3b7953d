"""Recovery of a modem: one action after the other, each after a pause.

    fault of the modem    register again, radio off and on, reset, then a power cycle, which only the supervisor can do
    no network            the same actions without the power cycle, repeated without end. A car park may have no
                          network for a night, and a power cycle does not help there. The modem searches during pauses.

The pauses are 5 s, 10 s, 20 s and so on, at most 10 minutes. After STEADY_S of up, actions and pauses start again with
the first one.
"""

import random
from collections.abc import Callable
from enum import Enum

from drivers.sim8202g.script import Pause, Script, StepError, ask, lines
from drivers.sim8202g.steps import Steps

FIRST_S = 5.0
MOST_S = 600.0
# Random share by which a pause is longer or shorter: the modems of a fleet lose the same cell at the same time.
JITTER = 0.2
STEADY_S = 300.0
RADIO_OFF_S = 5.0


class Rung(Enum):
    """A recovery action; its value is the text after "next:" in messages."""

    REGISTER = "registers again"
    RADIO = "radio off and on"
    RESET = "reset of the modem"
    POWER = "power cycle"


RUNGS = tuple(Rung)


class Ladder:
    """Selection of the next recovery action, and of the pause before it.

    chance  function that returns a random number from 0 to 1.
    """

    def __init__(self, chance: Callable[[], float] = random.random) -> None:
        self._chance = chance
        self._faults = self._losses = 0

    def fault(self) -> tuple[Rung, float]:
        """Return the next action against a fault of the modem, and the pause before it in seconds."""
        self._faults += 1
        return RUNGS[min(self._faults, len(RUNGS)) - 1], self._delay(self._faults)

    def loss(self) -> tuple[Rung, float]:
        """Return the next action against a loss of the network, and the pause before it in seconds."""
        self._losses += 1
        return RUNGS[(self._losses - 1) % (len(RUNGS) - 1)], self._delay(self._losses)

    def steady(self) -> None:
        """Start again with the first action, because the modem was up for STEADY_S or will lose its power."""
        self._faults = self._losses = 0

    def _delay(self, times: int) -> float:
        pause = min(MOST_S, FIRST_S * 2.0 ** min(times - 1, 16))
        return pause * (1.0 + JITTER * (2.0 * self._chance() - 1.0))


def climb(rung: Rung, steps: Steps) -> Script[str]:
    """Execute an action other than a power cycle; return the step at which bring-up continues.

    Raises StepError if the modem refuses a command.
    """
    if rung is Rung.REGISTER:
        for text in ("AT+CGATT=0", "AT+COPS=0", "AT+CGATT=1"):
            yield from ask(text)  # a refusal is ignored: a modem that is not attached refuses to detach
        return "sim"
    if rung is Rung.RADIO:
        yield from lines("AT+CFUN=4")
        yield Pause(RADIO_OFF_S)
        yield from lines("AT+CFUN=1")
        return "sim"
    if rung is Rung.RESET:
        yield from steps.reenumerate("AT+CRESET")
        return "port"
    raise StepError(f"unsupported by the driver: {rung.value}")
