"""Simulated SIM8202G-M2: an AT port on a pty that boots and registers, and that fails on request.

Failures are lost coverage, crashes and false answers. The modem may be in a slot of drivers/sim/machine.py, or tests
use it alone, with their own callbacks. Its functions never block.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from board.runtime.loop import Loop, Timer
from drivers.sim.modem.commands import reply
from drivers.sim.modem.network import AIRS, Access, SimulatedNetwork
from drivers.sim.tty_end import TtyEnd
from drivers.sim.usb_tree import SimulatedDevice, SimulatedInterface

KEPT = 1000
BUFFER = 64 * 1024  # octets that are kept for a reader that does not read; further octets are lost

BOOT_S = 18.0  # seconds from power to the device at USB
DEAF_S = 2.0  # seconds from USB to the first answer
BUSY_S = 4.0  # seconds from USB until the card is readable
LEAVE_S = 1.0  # seconds from the OK to a reset until the device leaves USB

POWER_ON = True, 1, True, True  # echo, functionality, is_deaf and is_busy after power-on

AT_INTERFACES = {"9001": 2, "9011": 4, "901e": 2}


@dataclass
class Card:
    """SIM card.

    state  answer to AT+CPIN?: READY, SIM PIN or SIM PUK.
    tries  PINs that were entered.
    """

    is_there: bool = True
    state: str = "READY"
    pin: str = "1234"
    attempts: int = 3
    tries: list[str] = field(default_factory=list)

    @property
    def is_ready(self) -> bool:
        return self.is_there and self.state == "READY"


class SimulatedModem:
    """Simulated modem module.

    plug, unplug  callbacks when a device appears at USB and disappears.
    path          tty to use as the module's end of its AT port, such as that of a USB gadget; empty: a pty.
    is_plugged    True while the device is at USB.
    boots         number of boots.
    asked         last KEPT command lines.
    answers       False: the modem accepts commands and does not answer.
    lies          called with each command; returns the text to send as answer, or None for the normal answer.
    """

    def __init__(
        self,
        loop: Loop,
        plug: Callable[[SimulatedDevice], None],
        unplug: Callable[[], None],
        network_device: str = "",
        path: str = "",
    ) -> None:
        self.loop = loop
        self.card = Card()
        self.network = SimulatedNetwork(loop, self._registration_changed)
        self.product = "9001"
        self.mode = 2
        self.context = ("IP", "")
        self.celsius = 38
        self.boot_s = BOOT_S
        self.answers = True
        self.lies: Callable[[str], str | None] = lambda text: None
        self.asked: list[str] = []
        self.boots = 0
        self._plug = plug
        self._unplug = unplug
        self._network_device = network_device
        self._is_gadget = bool(path)
        self._timers: list[Timer] = []
        self._end = TtyEnd(loop, self._hear, path, BUFFER)
        self.is_plugged = False
        self.echo, self.functionality, self.is_deaf, self.is_busy = POWER_ON
        self._heard = b""  # incomplete command line

    # -- power

    def supplied(self, is_on: bool) -> None:
        """Switch the supply on or off; with the supply on, the modem boots by itself."""
        self._off()
        if is_on:
            self._later(self.boot_s, self._boot)

    def restart(self) -> None:
        """Leave USB after LEAVE_S and boot, as after AT+CRESET."""
        self._later(LEAVE_S, self.crash)

    def crash(self) -> None:
        """Leave USB at once, and boot."""
        self.supplied(True)

    def close(self) -> None:
        """End the simulation; idempotent."""
        self._off()

    # -- actions of tests

    def say(self, octets: bytes) -> None:
        """Send octets that do not answer a command."""
        self._end.say(octets)

    def unsolicited(self, line: str) -> None:
        self.say(f"\r\n{line}\r\n".encode())

    def babble(self, octets: bytes, every_s: float) -> None:
        """Send octets periodically until the next boot."""
        self.say(octets)
        self._later(every_s, lambda: self.babble(octets, every_s))

    # -- internal functions

    def _off(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        self.network.leave()
        if self.is_plugged:
            self.is_plugged = False
            self._unplug()
        self._end.close()
        self.echo, self.functionality, self.is_deaf, self.is_busy = POWER_ON
        self._heard = b""
        if self.card.state == "READY" and self.card.tries:
            self.card.state = "SIM PIN"  # a card with a PIN requires it after each loss of power

    def _boot(self) -> None:
        self.boots += 1
        if not self._is_gadget:
            self._end.open()
        self.is_plugged = True
        self._plug(self._device(self._end.path))
        self._end.open()  # a gadget's tty exists only from now on
        self.say(b"\0\0\0")
        self._later(DEAF_S, self._listen)
        self._later(BUSY_S, self._card_read)

    def _device(self, path: str) -> SimulatedDevice:
        at = AT_INTERFACES[self.product]
        drivers = [SimulatedInterface(number) for number in range(5) if number != at]
        drivers.append(SimulatedInterface(at, "option", path))
        if self.product == "9011":
            drivers[0] = SimulatedInterface(0, "rndis_host", self._network_device or "usb0")
        elif self.product == "9001":
            drivers.append(SimulatedInterface(5, "qmi_wwan", self._network_device or "wwan0"))
        else:
            drivers.append(SimulatedInterface(5, "cdc_mbim", self._network_device or "wwan0"))
        return SimulatedDevice("1e0e", self.product, drivers, "SIMCOM", "SDXPRAIRIE-MTP")

    def _listen(self) -> None:
        self.is_deaf = False
        self.unsolicited("RDY")

    def _card_read(self) -> None:
        self.is_busy = False
        self.unsolicited(f"+CPIN: {self.card.state}" if self.card.is_there else "+CPIN: NOT INSERTED")
        if self.card.is_ready:
            self.unsolicited("SMS DONE")
            self.unsolicited("PB DONE")
            self.network.search()

    def _hear(self, octets: bytes) -> None:
        if self.is_deaf or not self.answers:
            return
        *texts, self._heard = (self._heard + octets.replace(b"\n", b"")).split(b"\r")
        for text in texts:
            self._obey(text.decode("ascii", "replace"))

    def _obey(self, text: str) -> None:
        self.asked.append(text)
        del self.asked[:-KEPT]
        if self.echo:
            self.say(text.encode() + b"\r")
        lie = self.lies(text)
        if lie is not None:
            self.say(lie.encode())
            return
        found = reply(self, text)
        said = "".join(f"\r\n{line}\r\n" for line in (*found.lines, found.final))
        self._later(found.delay_s, lambda: self.say(said.encode()))

    def _registration_changed(self) -> None:
        if self.is_plugged and not self.is_deaf:
            domain = "C5GREG" if self.network.camped is Access.SA else "CEREG"
            self.unsolicited(f"+{domain}: {self.network.status(domain)}")
            self.unsolicited(f"+CNSMOD: {8 if self.network.is_registered else 0}")

    def _later(self, delay: float, call: Callable[[], None]) -> None:
        self._timers = [timer for timer in self._timers if timer.is_pending]
        self._timers.append(self.loop.after(delay, call))


__all__ = ["AIRS", "Access", "Card", "SimulatedModem"]
