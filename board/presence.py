"""Who sits in a slot: the right device, a wrong one, none, or one that comes and goes."""

from collections import deque
from collections.abc import Callable

from board.description import SlotDescription
from board.errors import InterfaceError
from board.usb import SHOW, Device

# A modem leaves its place twice when it changes what it is on USB. More often in FLAP_S is nobody's plan.
FLAPS = 5
FLAP_S = 60.0


class Presence:
    """What look() finds at a slot's place, judged.

    losses  times that its device went, from the start.
    """

    def __init__(
        self, description: SlotDescription, look: Callable[[], Device | None], clock: Callable[[], float]
    ) -> None:
        self.losses = 0
        self._description = description
        self._look = look
        self._clock = clock
        self._lost_at: deque[float] = deque(maxlen=FLAPS)

    @property
    def is_known(self) -> bool:
        """Whether the board file says where to look."""
        return bool(self._description.usb)

    @property
    def is_empty(self) -> bool:
        """Whether nothing at all is at its place."""
        return self.is_known and self._look() is None

    def find(self) -> Device | None:
        """Its device: one that belongs there, and that the kernel may use."""
        found = self._look() if self.is_known else None
        ids = self._description.ids
        return found if found is not None and found.is_authorized and (not ids or found.id in ids) else None

    def lose(self) -> InterfaceError | None:
        """Its device went; the fault of it where that happens too often."""
        now = self._clock()
        self.losses += 1
        self._lost_at.append(now)
        if len(self._lost_at) < FLAPS or now - self._lost_at[0] > FLAP_S:
            return None
        return InterfaceError(
            f"its device at {self._description.usb} went {FLAPS} times within {FLAP_S:g} s",
            "a bad contact, a supply that breaks down, or firmware that crashes",
        )

    def calm(self) -> None:
        """Its supply is cut: what it did before does not count any more."""
        self._lost_at.clear()

    def why_absent(self) -> InterfaceError:
        """What is wrong when its time is over."""
        found = self._look()
        place, wait_s = self._description.usb, self._description.wait_s
        if found is None:
            return InterfaceError(f"no USB device at {place} within {wait_s:g} s", f"is the module in its slot? {SHOW}")
        if not found.is_authorized:
            return InterfaceError(f"{found} at {place} is not authorized", "somebody wrote 0 to `authorized`: cycle it")
        expected = " or ".join(self._description.ids)
        return InterfaceError(
            f"{found} is at {place}, where {expected} belongs",
            "put the right module into the slot, or its id into the board file",
        )
