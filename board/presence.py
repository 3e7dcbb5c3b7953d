"""Presence of a slot's device: right, wrong, missing, or flapping."""

from collections import deque
from collections.abc import Callable

from board.description import SlotDescription
from board.runtime.errors import InterfaceError
from board.usb import SHOW, UsbDevice

# A modem that changes its USB mode disappears twice. FLAPS losses within FLAP_S are a fault.
FLAPS = 5
FLAP_S = 60.0


class Presence:
    """Judges the device that look() finds at a slot's USB port.

    losses  number of times that the device disappeared since the start.
    """

    def __init__(
        self, description: SlotDescription, look: Callable[[], UsbDevice | None], clock: Callable[[], float]
    ) -> None:
        self.losses = 0
        self._description = description
        self._look = look
        self._clock = clock
        self._lost_at: deque[float] = deque(maxlen=FLAPS)

    @property
    def is_known(self) -> bool:
        """True if the board file gives the slot's USB port."""
        return bool(self._description.usb)

    @property
    def is_empty(self) -> bool:
        """True if the USB port is known and has no device."""
        return self.is_known and self._look() is None

    def find(self) -> UsbDevice | None:
        """Return the slot's device if its id is a permitted one and the kernel may use it, else None."""
        found = self._look() if self.is_known else None
        ids = self._description.ids
        return found if found is not None and found.is_authorized and (not ids or found.id in ids) else None

    def count_loss(self) -> InterfaceError | None:
        """Count a loss of the device; return a fault after FLAPS losses within FLAP_S."""
        now = self._clock()
        self.losses += 1
        self._lost_at.append(now)
        if len(self._lost_at) < FLAPS or now - self._lost_at[0] > FLAP_S:
            return None
        return InterfaceError(
            f"its device at {self._description.usb} disappeared {FLAPS} times within {FLAP_S:g} s",
            "check contacts, supply and firmware",
        )

    def forget_losses(self) -> None:
        """Forget the counted losses, because the slot's power is cut."""
        self._lost_at.clear()

    def why_absent(self) -> InterfaceError:
        """Return the fault of a slot whose device did not appear within wait_s: absent, not authorized or wrong."""
        found = self._look()
        place, wait_s = self._description.usb, self._description.wait_s
        if found is None:
            return InterfaceError(
                f"no USB device at {place} within {wait_s:g} s", f"check that the module is in its slot; {SHOW}"
            )
        if not found.is_authorized:
            return InterfaceError(f"{found} at {place} is not authorized", "`authorized` was set to 0: cycle the slot")
        expected = " or ".join(self._description.ids)
        return InterfaceError(
            f"wrong device at {place}: {found}, expected {expected}",
            "insert the right module, or add its id to the board file",
        )
