"""Listener of pulses for tests of their sources."""

from collections.abc import Callable

from board.runtime.errors import InterfaceError
from pps.pulse import Pulse


class Told:
    """An Above that notes what it is told, all of it in `all`, in its order."""

    def __init__(self) -> None:
        self.pulses: list[Pulse] = []
        self.gaps: list[int] = []
        self.errors: list[InterfaceError] = []
        self.all: list[Pulse | int | InterfaceError] = []
        self.then: Callable[[], None] = lambda: None  # done at each word

    def pulse(self, pulse: Pulse) -> None:
        self.pulses.append(pulse)
        self._note(pulse)

    def missed(self, count: int) -> None:
        self.gaps.append(count)
        self._note(count)

    def failed(self, error: InterfaceError) -> None:
        self.errors.append(error)
        self._note(error)

    def _note(self, what: Pulse | int | InterfaceError) -> None:
        self.all.append(what)
        self.then()
