"""What is done about a modem that does not come up or does not stay: one means after the other, each after a pause.

    a fault of the modem    register again, radio off and on, reset, then its power (which only the supervisor has)
    no network              the same without the last, over and over: a car park has none for a night, and power helps
                            nobody there. While it is waited the network is still looked for.

The pauses are 5 s, 10 s, 20 s and so on, 10 minutes at most. What has been up for STEADY_S begins anew.
"""

import random
from collections.abc import Callable
from enum import Enum

from drivers.modem_script import Pause, Script, StepError, ask, lines
from drivers.modem_steps import Steps

FIRST_S = 5.0
MOST_S = 600.0
JITTER = 0.2  # of a pause: the modems of a fleet lose the same mast at the same time
STEADY_S = 300.0
RADIO_OFF_S = 5.0


class Rung(Enum):
    """A means, in words that follow 'next:'."""

    REGISTER = "registers again"
    RADIO = "radio off and on"
    RESET = "reset of the modem"
    POWER = "power cycle"


RUNGS = tuple(Rung)


class Ladder:
    """Which means is next, and how long it is waited before."""

    def __init__(self, chance: Callable[[], float] = random.random) -> None:
        self._chance = chance
        self._faults = self._losses = 0

    def fault(self) -> tuple[Rung, float]:
        """The next means against a fault of the modem."""
        self._faults += 1
        return RUNGS[min(self._faults, len(RUNGS)) - 1], self._delay(self._faults)

    def loss(self) -> tuple[Rung, float]:
        """The next means where there is no network."""
        self._losses += 1
        return RUNGS[(self._losses - 1) % (len(RUNGS) - 1)], self._delay(self._losses)

    def steady(self) -> None:
        """It has been up for STEADY_S, or has lost its power."""
        self._faults = self._losses = 0

    def _delay(self, times: int) -> float:
        pause = min(MOST_S, FIRST_S * 2.0 ** min(times - 1, 16))
        return pause * (1.0 + JITTER * (2.0 * self._chance() - 1.0))


def climb(rung: Rung, steps: Steps) -> Script[str]:
    """Use a means other than power; returns the step that bring-up goes on with. Raises StepError."""
    if rung is Rung.REGISTER:
        for text in ("AT+CGATT=0", "AT+COPS=0", "AT+CGATT=1"):
            yield from ask(text)  # what it has left already it refuses to leave
        return "sim"
    if rung is Rung.RADIO:
        yield from lines("AT+CFUN=4")
        yield Pause(RADIO_OFF_S)
        yield from lines("AT+CFUN=1")
        return "sim"
    if rung is Rung.RESET:
        yield from steps.reenumerate("AT+CRESET")
        return "port"
    raise StepError(f"{rung.value} is nothing that a driver does")
