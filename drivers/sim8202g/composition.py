"""USB composition that a bearer needs: switches the modem to it, a limited number of times."""

from board.runtime.errors import BlockedError
from drivers.sim8202g.bearer import COMPOSITIONS

MOST_SWITCHES = 2  # in a row: each one resets the modem and writes to flash memory of unknown endurance


class Composition:
    """USB composition of one modem, and the number of switches.

    It survives a stop of the driver: each switch takes the modem off USB, which stops the driver of a modem in a slot.
    """

    def __init__(self, bearer: str) -> None:
        self._bearer = bearer
        self._wanted = COMPOSITIONS.get(bearer)
        self._switches = 0

    def switch(self, vendor: int, product: int) -> str | None:
        """Return the AT command that switches the modem to the needed composition; None if no switch is needed.

        vendor, product  USB IDs of the current composition.

        Raises BlockedError if the modem still has another composition after MOST_SWITCHES switches.
        """
        if self._wanted is None or (vendor, product) == self._wanted:
            self._switches = 0
            return None
        wanted = "{:04x}:{:04x}".format(*self._wanted)
        if self._switches == MOST_SWITCHES:
            raise BlockedError(
                f"the modem keeps USB composition {vendor:04x}:{product:04x}; bearer {self._bearer} needs {wanted}",
                "set bearer to the one that fits the modem's composition",
            )
        self._switches += 1
        return "AT+CUSBCFG=usbid,{:04x},{:04x}".format(*self._wanted)
