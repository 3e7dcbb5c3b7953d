"""A simulated SIM8202G-M2: an AT port on a pty that boots, registers, loses coverage, crashes and lies as told.

It sits in a place of drivers/sim/machine.py, or stands alone with hooks of one's own; nothing in it waits.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from board.loop import Loop, Timer
from drivers.sim.modem_commands import reply
from drivers.sim.modem_network import AIRS, Access, SimulatedNetwork
from drivers.sim.tty_end import TtyEnd
from drivers.sim.usb_tree import SimulatedDevice, SimulatedInterface

KEPT = 1000
BUFFER = 64 * 1024  # octets that wait for who does not read; what is said beyond is lost

BOOT_S = 18.0  # from power to USB
DEAF_S = 2.0  # from there to the first answer
BUSY_S = 4.0  # and to a card that can be asked
LEAVE_S = 1.0  # from OK to a reset to leaving USB

AT_INTERFACES = {"9001": 2, "9011": 4, "901e": 2}


@dataclass
class Card:
    """A SIM. state is what AT+CPIN? says: READY, SIM PIN, SIM PUK. tries: the PINs that were tried."""

    is_there: bool = True
    state: str = "READY"
    pin: str = "1234"
    attempts: int = 3
    tries: list[str] = field(default_factory=list)

    @property
    def is_ready(self) -> bool:
        return self.is_there and self.state == "READY"


class SimulatedModem:
    """A module.

    plug, unplug  what happens at USB: a device appears, and disappears.
    path          a tty that is the module's own end of its AT port, such as that of a USB gadget; empty: a pty.
    is_plugged    whether it is at USB.
    boots         how often it has booted. asked: the last KEPT command lines that it got.
    answers       False: it takes everything and says nothing.
    lies          called with each command; what it returns is said in place of the answer, None lets it pass.
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
        self._heard = b""  # of a command
        self._reset()

    # -- power

    def supplied(self, is_on: bool) -> None:
        """Power comes or goes; on, it boots by itself."""
        self._off()
        if is_on:
            self._later(self.boot_s, self._boot)

    def restart(self) -> None:
        """As after AT+CRESET: it leaves USB a moment later, and boots."""
        self._later(LEAVE_S, self.crash)

    def crash(self) -> None:
        """Leave USB now, and boot."""
        self.supplied(True)

    def close(self) -> None:
        """The end of the simulation; idempotent."""
        self._off()

    # -- what it may be told to do

    def say(self, octets: bytes) -> None:
        """Anything, unasked."""
        self._end.say(octets)

    def unsolicited(self, line: str) -> None:
        self.say(f"\r\n{line}\r\n".encode())

    def babble(self, octets: bytes, every_s: float) -> None:
        """Say octets again and again, until it boots."""
        self.say(octets)
        self._later(every_s, lambda: self.babble(octets, every_s))

    # -- inside

    def _reset(self) -> None:
        """As it wakes up."""
        self.echo = True
        self.functionality = 1
        self.is_deaf = self.is_busy = True
        self._heard = b""

    def _off(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        self.network.leave()
        if self.is_plugged:
            self.is_plugged = False
            self._unplug()
        self._end.close()
        self._reset()
        if self.card.state == "READY" and self.card.tries:
            self.card.state = "SIM PIN"  # a card that has one asks for it after each loss of power

    def _boot(self) -> None:
        self.boots += 1
        if not self._is_gadget:
            self._end.open()
        self.is_plugged = True
        self._plug(self._device(self._end.path))
        self._end.open()  # of a gadget only now it is there
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
