"""GPIO output lines: active or inactive, independent of their voltage."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from board.description import LineDescription
from board.gpiochip import DEV, library, place, request, told
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop, Timer


class Line(Protocol):
    """Output line, as a slot or a blinker uses it."""

    @property
    def is_active(self) -> bool:
        """State read from the line, which may differ from the one set. Raises InterfaceError if it cannot be read."""

    def set(self, is_active: bool) -> None:
        """Set the line. Raises InterfaceError if the chip is gone, or the line does not follow."""

    def close(self) -> None:
        """Release the line; idempotent."""


class OutputLine:
    """Exclusive output line of a GPIO chip, until it is closed.

    A line with initial = "keep" remains as found, even as an input, until the first set(). A closed line keeps its
    state only if its driver allows: a BCM2711 without `persist_gpio_outputs` makes it an input again.
    """

    def __init__(self, description: LineDescription, dev: Path = DEV) -> None:
        """Request the line. Raises InterfaceError if it is absent, in use or not permitted."""
        self._gpiod = library()
        self._values = (self._gpiod.line.Value.INACTIVE, self._gpiod.line.Value.ACTIVE)
        self._description = description
        self._is_driven = description.initial != "keep"
        self.where = place(description, dev)
        settings = self._output(description.initial == "active") if self._is_driven else self._as_found()
        self._request, self._offset = request(description, dev, settings)

    @property
    def is_active(self) -> bool:
        with told(self.where):
            return bool(self._request.get_value(self._offset) == self._values[True])

    def set(self, is_active: bool) -> None:
        """Drive the line.

        Raises InterfaceError if the line is gone, or still reads the other level because another part drives it.
        """
        with told(self.where):
            if self._is_driven:
                self._request.set_value(self._offset, self._values[is_active])
            else:
                self._request.reconfigure_lines({self._offset: self._output(is_active)})
                self._is_driven = True
        if self._is_held(is_active) and self.is_active != is_active:
            words = ("inactive", "active")
            raise InterfaceError(
                f"{self.where}: set {words[is_active]}, but reads {words[not is_active]}",
                "another chip drives the line, or it is shorted: measure it; compare the board file with the circuit",
            )

    def close(self) -> None:
        """Release the line; idempotent."""
        self._request.release()

    def _as_found(self) -> Any:
        line = self._gpiod.line
        return self._gpiod.LineSettings(direction=line.Direction.AS_IS, active_low=self._description.active_low)

    def _output(self, is_active: bool) -> Any:
        line = self._gpiod.line
        return self._gpiod.LineSettings(
            direction=line.Direction.OUTPUT,
            drive=line.Drive.OPEN_DRAIN if self._description.open_drain else line.Drive.PUSH_PULL,
            active_low=self._description.active_low,
            output_value=self._values[is_active],
        )

    def _is_held(self, is_active: bool) -> bool:
        """Return whether this state is driven. An open-drain line drives low only; other parts may pull it low too."""
        return not self._description.open_drain or is_active == self._description.active_low


class Lines:
    """Lines of the board file on GPIO chips, not on expanders; each is opened once and kept open.

    faults  error by name of a line that could not be opened or set. Each further use of the line tries again.
    """

    def __init__(
        self,
        descriptions: Mapping[str, LineDescription],
        dev: Path = DEV,
        open_line: Callable[[LineDescription, Path], Line] = OutputLine,
    ) -> None:
        self.faults: dict[str, InterfaceError] = {}
        self._described = {name: line for name, line in descriptions.items() if not line.expander}
        self._dev = dev
        self._open_line = open_line
        self._lines: dict[str, Line] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._described

    def open(self) -> None:
        """Open all lines and set their initial states; errors are put into faults."""
        for name in self._described:
            with contextlib.suppress(InterfaceError):  # _line() put it into faults
                self._line(name)

    def set(self, name: str, is_active: bool) -> None:
        """Set a line. Raises InterfaceError if it cannot be opened or does not follow."""
        line = self._line(name)
        try:
            line.set(is_active)
        except InterfaceError as error:
            self.faults[name] = error
            raise
        self.faults.pop(name, None)

    def is_active(self, name: str) -> bool:
        """Read the state of a line. Raises InterfaceError if it cannot be opened."""
        return self._line(name).is_active

    def close(self) -> None:
        """Release all lines without changing them; idempotent."""
        for line in self._lines.values():
            line.close()
        self._lines.clear()

    def _line(self, name: str) -> Line:
        if name not in self._lines:
            try:
                self._lines[name] = self._open_line(self._described[name], self._dev)
            except InterfaceError as error:
                self.faults[name] = InterfaceError(f"line {name}: {error.message}", error.hint)
                raise self.faults[name] from error
            self.faults.pop(name, None)
        return self._lines[name]


class Blinker:
    """Switches a line between active and inactive by timers."""

    def __init__(self, loop: Loop, line: Line) -> None:
        self._loop = loop
        self._line = line
        self._timer: Timer | None = None

    @property
    def is_busy(self) -> bool:
        return self._timer is not None and self._timer.is_pending

    def blink(self, durations_s: Sequence[float], done: Callable[[InterfaceError | None], None]) -> None:
        """Start with the active state; call done() at the end, or with the error that ended it. Not while is_busy."""
        self._timer = self._loop.after(0.0, lambda: self._step(durations_s, 0, done))

    def stop(self) -> None:
        """End blinking, make the line inactive, and do not call done(); idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            with contextlib.suppress(InterfaceError):  # if the chip is gone, the line cannot be set
                self._line.set(False)

    def _step(self, durations_s: Sequence[float], place: int, done: Callable[[InterfaceError | None], None]) -> None:
        is_over = place == len(durations_s)
        try:
            self._line.set(place % 2 == 0 and not is_over)
        except InterfaceError as error:
            done(error)
            return
        if is_over:
            done(None)
        else:
            self._timer = self._loop.after(durations_s[place], lambda: self._step(durations_s, place + 1, done))
