"""Steps of a modem's life: time limit of each, and its text for users."""

from typing import NamedTuple


class Step(NamedTuple):
    """A step.

    words    text for users, as the predicate of a sentence: "the modem ...".
    limit_s  time limit; None: no limit.
    """

    words: str
    limit_s: float | None = None


# A module takes 18 to 30 s from power-on to its first answer. In a reset it takes as long to leave USB.
BRING_UP = {
    "port": Step("waits for its AT port", 90.0),
    "identity": Step("is asked what it is", 60.0),
    "sim": Step("looks at the SIM", 60.0),
    "configuration": Step("sets radio and network mode", 90.0),
    "registration": Step("registers with the network", 180.0),
    "attach": Step("attaches to the packet service", 200.0),
    "bearer": Step("connects", 120.0),
}
STEPS = {
    **BRING_UP,
    "up": Step("is up"),
    "blocked": Step("waits for an operator"),
    "recovery": Step("recovers"),
    "restart": Step("restarts"),
    "stopped": Step("is stopped"),
}


def words(step: str, more: str = "") -> str:
    """Return the text of a step for users; a name that is not in STEPS is returned unchanged.

    more  text that follows after a colon, such as what the step waits for.
    """
    known = STEPS.get(step)
    return f"{known.words if known else step}{': ' if more else ''}{more}"
