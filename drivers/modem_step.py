"""The steps of a modem's life: how long each may take, and what it is called where a user reads of it."""

from typing import NamedTuple


class Step(NamedTuple):
    """words follow `the modem`; limit_s: None where it takes as long as it takes."""

    words: str
    limit_s: float | None = None


# A module takes 18 to 30 s from power to its first answer, and as long to leave USB in a reset.
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
    "blocked": Step("waits for somebody to help"),
    "recovery": Step("recovers"),
    "restart": Step("restarts"),
    "stopped": Step("is stopped"),
}


def words(step: str, more: str = "") -> str:
    """A step as a user reads it, with what in it is waited for; a name that is in no table stays as it is."""
    known = STEPS.get(step)
    return f"{known.words if known else step}{': ' if more else ''}{more}"
