"""Modules in the slots of a simulated board; each boots when its supply comes."""

import os
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from board.runtime.address import address
from board.runtime.free_udp import free_udp
from board.runtime.loop import Loop, Timer
from board.time.scales import GPS_EPOCH, GPS_LEAPS, leap_seconds
from drivers.sim.machine import SimulatedDevice, SimulatedInterface, SimulatedMachine
from drivers.sim.options import NeighboursOptions
from drivers.sim.radio.control import VARIABLE, Control

# Vendor and product. The SOM301-E is a USB network device with unpublished ids; these are the ids of Linux's gadget.
RECEIVER, RADIO, MODEM = "1546:01a9", "0525:a4a2", "1e0e:9001"

# Seconds from power to USB. A real radio takes 30 s, a real modem 18 s; that is too long for a demo.
RADIO_BOOT_S, MODEM_BOOT_S = 0.2, 1.0


class SimulatedModule(NamedTuple):
    """Simulated module in a slot.

    plays     its simulator, for faults.
    supplied  callback for changes of its supply.
    """

    plays: Any
    supplied: Callable[[bool], None]


class SlotPort(NamedTuple):
    """USB port of a slot.

    air  addresses of the simulated stations that the radio hears; None: none.
    """

    machine: SimulatedMachine
    usb: str
    air: NeighboursOptions | None

    def plug(self, device: SimulatedDevice) -> None:
        self.machine.plug(self.usb, device)

    def unplug(self) -> None:
        self.machine.unplug(self.usb)


def receiver(loop: Loop, place: SlotPort) -> SimulatedModule:
    """Create a ZED-F9P that drives around a block and has the current time."""
    from drivers.sim.receiver.habits import Habits
    from drivers.sim.receiver.receiver import Receiver
    from drivers.wire.gnss.time import Leap

    def appeared(path: str) -> None:
        port = SimulatedInterface(0, "cdc_acm", path)
        place.plug(SimulatedDevice("1546", "01a9", (port,), "u-blox AG", "u-blox GNSS receiver"))

    now = time.time()
    leap = Leap(GPS_LEAPS + leap_seconds(now))
    habits = Habits(gps_s=int(now) - GPS_EPOCH + leap.seconds, fraction_s=now % 1.0, leap=leap)
    made = Receiver(loop, habits, appeared=appeared, vanished=place.unplug)
    return SimulatedModule(made, made.power)


def modem(loop: Loop, place: SlotPort) -> SimulatedModule:
    """Create a SIM8202G-M2 with the network of a city."""
    from drivers.sim.modem.modem import SimulatedModem

    made = SimulatedModem(loop, place.plug, place.unplug)
    made.boot_s = MODEM_BOOT_S
    return SimulatedModule(made, made.supplied)


def radio(loop: Loop, place: SlotPort) -> SimulatedModule:
    """Create a SOM301-E."""
    made = Radio(loop, place)
    return SimulatedModule(made, made.supplied)


def stranger(loop: Loop, place: SlotPort) -> SimulatedModule:
    """Create a module whose USB ids no slot expects, to simulate a wrong module."""
    boot: list[Timer] = []

    def supplied(on: bool) -> None:
        if on:
            boot[:] = [loop.after(RADIO_BOOT_S, lambda: place.plug(SimulatedDevice("1d6b", "0104", title="other")))]
            return
        for timer in boot:
            timer.cancel()
        place.unplug()

    return SimulatedModule(None, supplied)


class Radio:
    """SOM301-E. The kernel sees a network device. Its messages come and go by the library of drivers/sim/radio.

    A process of the driver runs that library. The library reads its settings from the environment, and receives more at
    its control port.

    settings  value of the environment variable; a value that the user has set takes precedence.
    control   address of the control port.
    """

    def __init__(self, loop: Loop, place: SlotPort) -> None:
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
        """Send settings to the library; they are lost while no driver has loaded it."""
        Control(self.control).say(words)

    def _booted(self) -> None:
        network = SimulatedInterface(0, "rndis_host", "usb0")
        self._place.plug(SimulatedDevice("0525", "a4a2", (network,), "Unex", "SOM301-E"))


MODULES: Mapping[str, Callable[[Loop, SlotPort], SimulatedModule]] = {RECEIVER: receiver, RADIO: radio, MODEM: modem}
