"""What supplies a slot and holds it in reset: whichever of the means that USB and a carrier have is declared."""

from collections.abc import Callable
from typing import Literal

from board.description import SlotDescription
from board.errors import InterfaceError, StationError
from board.loop import Loop, Timer
from board.usb import Device

# Whoever switches has a deadline of its own; this is for one that never answers at all.
ANSWER_S = 15.0

# power and reset are lines of the slot's table; hub_port and authorize are for the device at its place.
Kind = Literal["power", "hub_port", "authorize", "reset"]
Done = Callable[[StationError | None], None]
Switch = Callable[[Kind, bool, Done], None]
Step = tuple[Kind, bool]


class Supply:
    """Switches one thing after the other, and says when all are: with None, or with the first that failed.

    means    what cuts its supply; None: nothing does.
    was_cut  whether it was cut by us; before, it is as the station found it.
    """

    def __init__(
        self, loop: Loop, description: SlotDescription, switch: Switch, look: Callable[[], Device | None]
    ) -> None:
        self.means = _means(description)
        self.was_cut = False
        self._loop = loop
        self._has_reset = bool(description.reset)
        self._switch = switch
        self._look = look
        self._timer: Timer | None = None
        self._step: object = None  # what is being switched: an answer to anything else comes too late

    def on(self, done: Done) -> None:
        """Hold it in reset and supply it; but a module that runs when the station starts is not reset."""
        found = self._look()
        is_held = self._has_reset and (self.was_cut or found is None)
        self._begin([*self._reset(is_held), *self._feed(True, found)], done)

    def release(self, done: Done) -> None:
        """Let go of reset."""
        self._begin([("reset", False)] if self._has_reset else [], done)

    def off(self, done: Done) -> None:
        """Hold it in reset and take its supply away; the one is done even if the other fails."""
        self.was_cut = True
        self._begin([*self._reset(self._has_reset), *self._feed(False, self._look())], done, goes_on=True)

    def stop(self) -> None:
        """Wait for nothing any more, and call nobody; what was begun may still happen."""
        self._step = None
        if self._timer is not None:
            self._timer.cancel()

    def _reset(self, is_held: bool) -> list[Step]:
        return [("reset", True)] if is_held else []

    def _feed(self, on: bool, found: Device | None) -> list[Step]:
        if self.means is None:
            return []
        # Only a device that is there can be authorized, and need not be when it is.
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

        silence = InterfaceError(f"no answer within {ANSWER_S:g} s", "what it did is not known: cycle the slot")
        self._timer = self._loop.after(ANSWER_S, lambda: answered(silence))
        self._switch(kind, on, answered)


def _means(description: SlotDescription) -> Kind | None:
    if description.power:
        return "power"
    if description.hub_port:
        return "hub_port"
    return "authorize" if description.usb else None
