"""What sits in the slots of a simulated board, by the ids that belong there: each boots when it is supplied."""

import os
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from board.address import address
from board.free_udp import free_udp
from board.loop import Loop, Timer
from board.time import GPS_EPOCH, GPS_LEAPS, leap_seconds
from drivers.sim.machine import SimulatedDevice, SimulatedInterface, SimulatedMachine
from drivers.sim.neighbours import NeighboursOptions
from drivers.sim.radio import VARIABLE, Control

# Vendor and product. The SOM301-E is a network on USB; its ids are not public: these are those of Linux' own gadget.
RECEIVER, RADIO, MODEM = "1546:01a9", "0525:a4a2", "1e0e:9001"

# From power to USB, s. A radio and a modem of flesh and blood take 30 and 18: nobody who tries a demo waits for that.
RADIO_BOOT_S, MODEM_BOOT_S = 0.2, 1.0


class Module(NamedTuple):
    """One that sits somewhere.

    plays     the simulator, for who wants to give it trouble.
    supplied  tells it that its supply has come or gone.
    """

    plays: Any
    supplied: Callable[[bool], None]


class Place(NamedTuple):
    """The USB port of a slot; air: where simulated stations are heard and hear."""

    machine: SimulatedMachine
    usb: str
    air: NeighboursOptions | None

    def plug(self, device: SimulatedDevice) -> None:
        self.machine.plug(self.usb, device)

    def unplug(self) -> None:
        self.machine.unplug(self.usb)


def receiver(loop: Loop, place: Place) -> Module:
    """A ZED-F9P that drives around a block, now."""
    from drivers.sim.receiver import Receiver
    from drivers.sim.receiver_habits import Habits
    from drivers.wire.gnss_time import Leap

    def appeared(path: str) -> None:
        port = SimulatedInterface(0, "cdc_acm", path)
        place.plug(SimulatedDevice("1546", "01a9", (port,), "u-blox AG", "u-blox GNSS receiver"))

    now = time.time()
    leap = Leap(GPS_LEAPS + leap_seconds(now))
    habits = Habits(gps_s=int(now) - GPS_EPOCH + leap.seconds, fraction_s=now % 1.0, leap=leap)
    made = Receiver(loop, habits, appeared=appeared, vanished=place.unplug)
    return Module(made, made.power)


def modem(loop: Loop, place: Place) -> Module:
    """A SIM8202G-M2 in a city."""
    from drivers.sim.modem import SimulatedModem

    made = SimulatedModem(loop, place.plug, place.unplug)
    made.boot_s = MODEM_BOOT_S
    return Module(made, made.supplied)


def radio(loop: Loop, place: Place) -> Module:
    """A SOM301-E."""
    made = Radio(loop, place)
    return Module(made, made.supplied)


def stranger(loop: Loop, place: Place) -> Module:
    """What belongs into no slot."""
    boot: list[Timer] = []

    def supplied(on: bool) -> None:
        if on:
            boot[:] = [loop.after(RADIO_BOOT_S, lambda: place.plug(SimulatedDevice("1d6b", "0104", title="other")))]
            return
        for timer in boot:
            timer.cancel()
        place.unplug()

    return Module(None, supplied)


class Radio:
    """For the kernel a network device. What it hears and says comes and goes by the library of drivers/sim/radio, which
    runs in a process of the driver's, reads its settings from the environment and is told more at its control port.

    settings  that the environment must have: those that it has already are of who runs the program.
    control   address of that port.
    """

    def __init__(self, loop: Loop, place: Place) -> None:
        self._loop = loop
        self._place = place
        self._boot: Timer | None = None
        (self.control,) = free_udp("127.0.0.1", 1)
        own = f"listen={place.air.to} peers={place.air.listen} control={self.control}" if place.air else ""
        self.settings = os.environ.get(VARIABLE, own)
        given = dict(word.partition("=")[::2] for word in self.settings.split())
        if "control" in given:
            self.control = address(given["control"])

    def supplied(self, on: bool) -> None:
        if self._boot is not None:
            self._boot.cancel()
        if on:
            self._boot = self._loop.after(RADIO_BOOT_S, self._booted)
        else:
            self._place.unplug()

    def say(self, words: str) -> None:
        """Tell the library something; nobody hears it while no driver has it loaded."""
        Control(self.control).say(words)

    def _booted(self) -> None:
        network = SimulatedInterface(0, "rndis_host", "usb0")
        self._place.plug(SimulatedDevice("0525", "a4a2", (network,), "Unex", "SOM301-E"))


MODULES: Mapping[str, Callable[[Loop, Place], Module]] = {RECEIVER: receiver, RADIO: radio, MODEM: modem}
