"""The USB composition that a bearer needs, and how often a modem may be told to have it."""

from board.errors import BlockedError
from drivers.modem_bearer import COMPOSITIONS

MOST_SWITCHES = 2  # in a row: each is a reset, and a write to flash memory whose endurance nobody states


class Composition:
    """Of one modem. It outlives a start(): each switch takes the modem off USB, and in a slot that stops the driver."""

    def __init__(self, bearer: str) -> None:
        self._bearer = bearer
        self._wanted = COMPOSITIONS.get(bearer)
        self._switches = 0

    def switch(self, vendor: int, product: int) -> str | None:
        """The command that gives the modem the composition; None where it has it.

        Raises BlockedError where it was given it MOST_SWITCHES times, and has another.
        """
        if self._wanted is None or (vendor, product) == self._wanted:
            self._switches = 0
            return None
        wanted = "{:04x}:{:04x}".format(*self._wanted)
        if self._switches == MOST_SWITCHES:
            raise BlockedError(
                f"the modem stays {vendor:04x}:{product:04x}, and bearer {self._bearer} needs {wanted}",
                "choose the bearer of the composition that it has",
            )
        self._switches += 1
        return "AT+CUSBCFG=usbid,{:04x},{:04x}".format(*self._wanted)
