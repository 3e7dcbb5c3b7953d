"""Rails, temperatures and fan: last readings of the worker, compared with limits."""

import logging
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, Protocol

from board.description import Hardware
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop, Timer

PERIOD_S = 5.0
# A reading that fails is retried less and less often, up to this period: a stuck bus may cost a worker each time.
LONGEST_S = 60.0
# Hysteresis as a fraction of the limit: a value that wavers about a limit is reported once.
MARGIN = 0.005

log = logging.getLogger("captain.board")


class Asks(Protocol):
    """Part of BoardWorker that Health uses."""

    def ask(self, do: str, arguments: Mapping[str, object], done: Callable[[Any], None]) -> None: ...


# A fan slower than STILL_RPM is stuck or unplugged if it is driven with DRIVEN_PERCENT or more. Many fans do not start
# with less drive.
DRIVEN_PERCENT = 30.0
STILL_RPM = 60.0


class Limit(NamedTuple):
    """Lower or upper limit of a quantity.

    quantity  v, a, c or rpm; a reading without this quantity never exceeds the limit.
    is_most   the bound is an upper limit.
    percent   least drive of the fan at which the limit applies.
    """

    quantity: str
    is_most: bool
    bound: float
    percent: float = 0.0

    def is_crossed(self, values: Mapping[str, float], was_crossed: bool) -> bool:
        value = values.get(self.quantity)
        if value is None or values.get("percent", 0.0) < self.percent:
            return False
        margin = abs(self.bound) * MARGIN if was_crossed else 0.0
        return value > self.bound - margin if self.is_most else value < self.bound + margin

    def __str__(self) -> str:
        return f"{'above' if self.is_most else 'below'} {self.bound:g} {UNITS[self.quantity]}"


UNITS = {"v": "V", "a": "A", "w": "W", "c": "degrees Celsius", "rpm": "rpm", "percent": "%"}


class Health:
    """Rails, temperatures and fan of the board, read periodically."""

    def __init__(self, loop: Loop, remote: Asks, hardware: Hardware, period_s: float = PERIOD_S) -> None:
        self._readings = [_Reading(loop, remote, period_s, *row) for row in _rows(hardware)]
        self._is_started = False

    def start(self) -> None:
        """Read all values now, then once per period."""
        if not self._is_started:
            self._is_started = True
            for reading in self._readings:
                reading.poll()

    def stop(self) -> None:
        """Stop reading; the last values remain, and their age grows. Idempotent."""
        self._is_started = False
        for reading in self._readings:
            reading.stop()

    @property
    def complaints(self) -> list[str]:
        """Exceeded limits and failed readings, in words."""
        return [complaint for reading in self._readings for complaint in reading.complaints()]

    def status(self) -> dict[str, object]:
        """Return the last values by table and name of the board file, with age, exceeded limits and fault.

        Example: {"rails": {"main": {"v": 12.01, "a": 0.5, "w": 6.0, "age_s": 2.1, "crossed": [], "fault": null}}, ...}
        """
        tables: dict[str, Any] = {}
        for reading in self._readings:
            if reading.name:
                tables.setdefault(reading.table, {})[reading.name] = reading.status()
            else:
                tables[reading.table] = reading.status()
        return tables


class _Reading:
    """Periodic reading of one row of the board file."""

    def __init__(
        self, loop: Loop, remote: Asks, period_s: float, table: str, do: str, name: str, limits: tuple[Limit, ...]
    ) -> None:
        self.table = table
        self.name = name
        self._loop = loop
        self._remote = remote
        self._period_s = period_s
        self._do = do
        self._limits = limits
        self._delay_s = period_s
        self._timer: Timer | None = None
        self._run = 0  # incremented by stop(), so that answers to earlier calls are ignored
        self._values: dict[str, float] = {}
        self._when: float | None = None
        self._crossed: set[Limit] = set()
        self._fault: InterfaceError | None = None

    def poll(self) -> None:
        run = self._run
        self._remote.ask(self._do, {"name": self.name} if self.name else {}, lambda value: self._answered(run, value))

    def stop(self) -> None:
        self._run += 1
        if self._timer is not None:
            self._timer.cancel()

    def complaints(self) -> list[str]:
        crossed = [f"{self._called}: {self._shown(limit.quantity)} is {limit}" for limit in self._in_order()]
        return [*crossed, *([f"{self._called}: {self._fault.message}"] if self._fault else [])]

    def status(self) -> dict[str, object]:
        """Return the last values with their age, exceeded limits and fault.

        v        voltage in V, of a rail.
        a        current in A, of a rail.
        w        power in W, of a rail.
        c        temperature in degrees C.
        rpm      speed of the fan, if it is counted.
        percent  drive of the fan, if it can be set.
        age_s    seconds since the values were read; null before the first.
        crossed  exceeded limits, in words.
        fault    error of the last reading; null without one.
        hint     remedy for the fault; null without one.
        """
        return {
            **self._values,
            "age_s": None if self._when is None else round(self._loop.clock() - self._when, 1),
            "crossed": [f"{limit.quantity} {limit}" for limit in self._in_order()],
            "fault": self._fault and self._fault.message,
            "hint": self._fault and self._fault.hint,
        }

    def _answered(self, run: int, outcome: Any) -> None:
        if run != self._run:
            return
        if isinstance(outcome, InterfaceError):
            self._failed(outcome)
        else:
            self._read(outcome if isinstance(outcome, dict) else {"c": outcome})
        self._timer = self._loop.after(self._delay_s, self.poll)

    def _failed(self, error: InterfaceError) -> None:
        self._delay_s = min(LONGEST_S, 2 * self._delay_s)
        if self._fault is None:  # log the first error only: later ones may differ by a process id; status has the last
            log.warning("%s: %s", self._called, error)
        self._fault = error

    def _read(self, values: dict[str, float]) -> None:
        self._delay_s = self._period_s
        self._values, self._when = values, self._loop.clock()
        if self._fault is not None:
            self._fault = None
            log.info("%s: answers again", self._called)
        for limit in self._limits:
            self._judge(limit)

    def _judge(self, limit: Limit) -> None:
        was_crossed = limit in self._crossed
        if limit.is_crossed(self._values, was_crossed) == was_crossed:
            return
        shown = self._shown(limit.quantity)
        if was_crossed:
            self._crossed.remove(limit)
            log.info("%s: %s, no longer %s", self._called, shown, limit)
        else:
            self._crossed.add(limit)
            log.warning("%s: %s is %s", self._called, shown, limit)

    @property
    def _called(self) -> str:
        return f"{self._do} {self.name}".strip()

    def _shown(self, quantity: str) -> str:
        value = self._values.get(quantity)
        return f"no {quantity}" if value is None else f"{value:.5g} {UNITS[quantity]}"

    def _in_order(self) -> list[Limit]:
        return [limit for limit in self._limits if limit in self._crossed]


def _rows(hardware: Hardware) -> Iterator[tuple[str, str, str, tuple[Limit, ...]]]:
    """Yield table, call, name and limits of each measured quantity."""
    for name, rail in hardware.rails.items():
        yield "rails", "rail", name, _limits(("v", False, rail.min_v), ("v", True, rail.max_v), ("a", True, rail.max_a))
    for name, temperature in hardware.temperatures.items():
        yield "temperatures", "temperature", name, _limits(("c", True, temperature.max_c))
    if hardware.fan is not None:
        yield "fan", "fan", "", (Limit("rpm", False, STILL_RPM, DRIVEN_PERCENT),)


def _limits(*given: tuple[str, bool, float | None]) -> tuple[Limit, ...]:
    return tuple(Limit(quantity, is_most, bound) for quantity, is_most, bound in given if bound is not None)
