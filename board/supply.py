"""Power and reset of a slot, switched by a line, expander or USB."""

from collections.abc import Callable
from typing import Literal

from board.description import SlotDescription
from board.runtime.errors import InterfaceError, StationError
from board.runtime.loop import Loop, Timer
from board.usb import UsbDevice

# Limit for a switch that never answers; each switch also has its own, shorter deadline.
ANSWER_S = 15.0

# power and reset are lines of the slot; hub_port and authorize act on the device at its USB port.
Kind = Literal["power", "hub_port", "authorize", "reset"]
Done = Callable[[StationError | None], None]
Switch = Callable[[Kind, bool, Done], None]
Step = tuple[Kind, bool]


class Supply:
    """Switches power and reset one after the other, then calls done() with None or the first error.

    means    switch of the supply; None: the slot has none.
    was_cut  the supply was cut since the start; before that, it is as the station found it.
    """

    def __init__(
        self, loop: Loop, description: SlotDescription, switch: Switch, look: Callable[[], UsbDevice | None]
    ) -> None:
        self.means = _means(description)
        self.was_cut = False
        self._loop = loop
        self._has_reset = bool(description.reset)
        self._switch = switch
        self._look = look
        self._timer: Timer | None = None
        self._step: object = None  # the switch call in progress; answers to earlier calls are late and ignored

    def on(self, done: Done) -> None:
        """Hold the slot in reset and supply it. A module that already ran at the station's start is not reset."""
        found = self._look()
        is_held = self._has_reset and (self.was_cut or found is None)
        self._begin([*self._reset(is_held), *self._feed(True, found)], done)

    def release(self, done: Done) -> None:
        """Release reset."""
        self._begin([("reset", False)] if self._has_reset else [], done)

    def off(self, done: Done) -> None:
        """Hold the slot in reset and cut its supply; each is done even if the other fails."""
        self.was_cut = True
        self._begin([*self._reset(self._has_reset), *self._feed(False, self._look())], done, goes_on=True)

    def stop(self) -> None:
        """Stop waiting for switches, without calling done(); a switch that is in progress may still take effect."""
        self._step = None
        if self._timer is not None:
            self._timer.cancel()

    def _reset(self, is_held: bool) -> list[Step]:
        return [("reset", True)] if is_held else []

    def _feed(self, on: bool, found: UsbDevice | None) -> list[Step]:
        if self.means is None:
            return []
        # Only a present device can be authorized or deauthorized; one that is in the wanted state needs nothing.
        if self.means == "authorize" and (found is None or found.is_authorized is on):
            return []
        return [(self.means, on)]

    def _begin(self, steps: list[Step], done: Done, goes_on: bool = False, failed: StationError | None = None) -> None:
        self.stop()
        if not steps or (failed and not goes_on):
            done(failed)
            return
        (kind, on), *rest = steps
        step = self._step = object()

        def answered(error: StationError | None) -> None:
            if self._step is not step:
                return
            named = error and InterfaceError(f"{kind} {'on' if on else 'off'}: {error.message}", error.hint)
            self._begin(rest, done, goes_on, failed or named)

        silence = InterfaceError(f"timeout after {ANSWER_S:g} s", "its state is unknown: cycle the slot")
        self._timer = self._loop.after(ANSWER_S, lambda: answered(silence))
        self._switch(kind, on, answered)


def _means(description: SlotDescription) -> Kind | None:
    if description.power:
        return "power"
    if description.hub_port:
        return "hub_port"
    return "authorize" if description.usb else None
