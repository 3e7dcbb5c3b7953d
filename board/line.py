"""A GPIO line as an output: active or inactive, whatever voltage that is."""

import contextlib
from collections.abc import Callable, Sequence

from board.errors import InterfaceError
from board.loop import Loop, Timer


class OutputLine:
    """One line, ours alone until it is closed; it begins and ends inactive."""

    def __init__(self, chip: str, offset: int, is_active_low: bool = False) -> None:
        """chip: `gpiochip0` or its path. Raises InterfaceError when it is absent, taken or not permitted."""
        import gpiod  # 49 ms that a station without lines saves
        from gpiod.line import Direction, Value

        self._values = (Value.INACTIVE, Value.ACTIVE)
        self._offset = offset
        settings = gpiod.LineSettings(direction=Direction.OUTPUT, output_value=Value.INACTIVE, active_low=is_active_low)
        path = chip if chip.startswith("/") else f"/dev/{chip}"
        try:
            self._request = gpiod.request_lines(path, consumer="captain", config={offset: settings})
        except (OSError, ValueError) as error:
            raise InterfaceError(f"{path}, line {offset}: {error}", "`gpioinfo` lists lines and their users") from error
        self._is_open = True

    def set(self, is_active: bool) -> None:
        """Set the line. Raises InterfaceError when the chip is gone."""
        try:
            self._request.set_value(self._offset, self._values[is_active])
        except OSError as error:
            raise InterfaceError(f"line {self._offset}: {error.strerror}") from error

    def close(self) -> None:
        """Make it inactive and give it back; idempotent."""
        if self._is_open:
            self._is_open = False
            with contextlib.suppress(InterfaceError):  # a chip that is gone has no line to set
                self.set(False)
            self._request.release()


class Blinker:
    """Makes a line active and inactive in turn, by timers."""

    def __init__(self, loop: Loop, line: OutputLine) -> None:
        self._loop = loop
        self._line = line
        self._timer: Timer | None = None

    @property
    def is_busy(self) -> bool:
        return self._timer is not None and self._timer.is_pending

    def blink(self, durations_s: Sequence[float], done: Callable[[InterfaceError | None], None]) -> None:
        """Begin, active first; done() is called at the end, or with the error that ended it. Not while is_busy."""
        self._timer = self._loop.after(0.0, lambda: self._step(durations_s, 0, done))

    def stop(self) -> None:
        """Leave the line as it is and call nobody; idempotent."""
        if self._timer is not None:
            self._timer.cancel()

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
