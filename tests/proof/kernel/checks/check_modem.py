"""The SIM8202G's driver and its simulated module, with the kernel's option driver and USB of our making between them."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from board import usb
from board.machine import REAL
from board.runtime.loop import Loop
from drivers.sim.modem.modem import SimulatedModem
from drivers.sim8202g.driver import Sim8202g
from drivers.sim8202g.options import ModemOptions
from tests.drivers.host import SHARED
from tests.drivers.sim8202g.modem import Station
from tests.proof.kernel.checks.gadget import MODEM, Gadget, modem_gadget
from tests.proof.kernel.checks.kernel import Hotplug, Seen, until

AT = 2  # the interface that is the AT port
NAMES = ("SIMCOM", "SDXPRAIRIE-MTP")
BOOT_S = 1.0


@pytest.fixture
def gadget() -> Iterator[Gadget]:
    with modem_gadget(NAMES) as made:
        yield made


@pytest.fixture
def modem(gadget: Gadget, loop: Loop) -> Iterator[SimulatedModem]:
    made = SimulatedModem(loop, lambda device: gadget.plug(), gadget.unplug, path=gadget.tty(AT))
    made.boot_s = BOOT_S
    yield made
    made.close()


def test_option_binds_and_the_at_port_is_found_by_its_place(gadget: Gadget, loop: Loop, seen: Seen) -> None:
    hotplug = Hotplug(loop)
    gadget.plug()
    until(loop, lambda: hotplug.told.count("add tty") == 4)
    device = usb.find(REAL, gadget.place)
    assert device is not None
    assert device.id == MODEM
    assert [(one.number, one.driver) for one in device.interfaces] == [(number, "option") for number in range(4)]
    seen(f"interface {AT} at {gadget.place} is {usb.tty(REAL, gadget.place, AT)}")
    gadget.unplug()
    until(loop, lambda: hotplug.told.count("remove tty") == 4)
    hotplug.close()
    until(loop, lambda: usb.find(REAL, gadget.place) is None)  # its ports go first
    seen("unplugged: its four ttys are told to be gone")


def test_the_driver_brings_it_up_and_again_after_it_was_unplugged(
    gadget: Gadget, modem: SimulatedModem, loop: Loop, seen: Seen, tmp_path: Path
) -> None:
    driver = Sim8202g(ModemOptions(usb=gadget.place, bearer="none", state_dir=str(tmp_path)), SHARED)
    station = Station(loop, driver)
    modem.supplied(True)
    until(loop, lambda: gadget.is_plugged)
    station.begin()
    took = until(loop, lambda: station.is_up, 120.0)
    seen(f"up after {took:.0f} s: {station.why}")
    modem.crash()
    until(loop, lambda: station.failures)
    seen(f"unplugged: {station.failures[0].message}")
    took = until(loop, lambda: station.is_running and station.is_up, 120.0)
    seen(f"up again after {took:.0f} s")
    driver.stop()
