"""The ZED-F9P's driver and its simulated receiver, with the kernel's cdc_acm and a USB of our making between them."""

from collections.abc import Iterator

import pytest

from board import usb
from board.machine import REAL
from board.runtime.loop import Loop
from board.time.scales import FixKind
from drivers.gnss.driver import ZedF9p
from drivers.gnss.options import GnssOptions
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver
from tests.drivers.host import SHARED, Host
from tests.proof.kernel.checks.gadget import Gadget
from tests.proof.kernel.checks.kernel import Seen, load, until


@pytest.fixture
def gadget() -> Iterator[Gadget]:
    load("cdc-acm")
    with Gadget("1546:01a9", ["acm.0"], controller=1, names=("u-blox AG", "u-blox GNSS receiver")) as made:
        made.plug()
        yield made


def test_cdc_acm_binds_and_the_port_is_found_by_its_place(gadget: Gadget, loop: Loop, seen: Seen) -> None:
    until(loop, lambda: _is_bound(gadget))
    device = usb.find(REAL, gadget.place)
    assert device is not None
    assert device.id == "1546:01a9"
    (named,) = (one for one in usb.devices(REAL) if one.topology == gadget.place)
    seen(f"{named} at {gadget.place} is {usb.tty(REAL, gadget.place, 0)}")


def test_the_driver_configures_it_and_has_fixes_and_is_told_when_it_is_unplugged(
    gadget: Gadget, loop: Loop, seen: Seen
) -> None:
    host, receiver = Host(loop), Receiver(loop, Habits(gadget=gadget.tty(0)))
    receiver.power(True)
    until(loop, lambda: receiver.boots and _is_bound(gadget))
    driver = ZedF9p(GnssOptions(usb=gadget.place, rate_hz=5), SHARED)
    driver.start(host)
    took = until(loop, lambda: host.failures or any(fix.kind == FixKind.FULL for fix in host.fixes))
    assert host.failures == []
    assert host.is_up
    until(loop, lambda: host.time_marks)
    seen(f"{host.links[-1][1]}; a fix after {took:.1f} s, {len(host.fixes)} epochs, time marks")
    gadget.unplug()
    until(loop, lambda: host.failures)
    seen(f"unplugged: {host.failures[0].message}")
    driver.stop()
    receiver.unplug()


def _is_bound(gadget: Gadget) -> bool:
    """Whether both interfaces are: the second is added once the first, which is the port, has its driver."""
    return [one.driver for one in getattr(usb.find(REAL, gadget.place), "interfaces", ())] == ["cdc_acm", "cdc_acm"]
