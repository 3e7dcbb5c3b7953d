"""What became of the station that systemd runs, with its own last words."""

from collections.abc import Callable, Iterator

from firmware.lab.checks import Finding, Level
from firmware.user import systemd
from firmware.user.systemd import Unit


def service(unit: Unit, journal: Callable[[], str]) -> Iterator[Finding]:
    """Whether it runs, and has done so without being started again. journal: asked where there is something to say."""
    told = systemd.state(unit)
    if systemd.is_active(unit) and not systemd.restarts(unit):
        yield Finding(Level.OK, "service", told)
        return
    is_starting = unit.get("ActiveState") == "activating" and not systemd.restarts(unit)
    level = Level.WARNING if systemd.is_active(unit) or is_starting else Level.PROBLEM
    words = "" if is_starting else systemd.last_words(journal())
    yield Finding(level, "service", f"{told}; its last words: {words}" if words else told, systemd.remedy(unit))
