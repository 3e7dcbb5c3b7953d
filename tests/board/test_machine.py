"""The simulated machine: what its files, its uevents and its modules do when something is plugged, cut or switched."""

import os
import pty

import pytest

from board import usb
from board.topology import of_devpath
from board.uevent import Uevents
from drivers.sim.machine import SimulatedDevice, SimulatedInterface, SimulatedMachine

PLACE = "1-1.3"
MODEM = SimulatedDevice(
    "1e0e", "9011", [SimulatedInterface(0, "rndis_host", "usb0"), SimulatedInterface(4, "option", "/dev/null")]
)


@pytest.fixture
def root(machine):
    return machine.machine


@pytest.fixture
def module(machine):
    """A modem that is there as soon as it has supply; the list says what it was told."""
    told = []

    def supplied(is_on):
        told.append(is_on)
        if is_on:
            machine.plug(PLACE, MODEM)

    machine.sit(PLACE, supplied)
    return told


@pytest.fixture
def events(loop, machine):
    events = []
    uevents = Uevents(loop, machine.machine, events.append)
    yield events
    uevents.close()


def files(root):
    """All but folders, which outlive what was in them: classes and drivers."""
    every = [*root.sys.rglob("*"), *root.dev.rglob("*")]
    return {str(path.relative_to(root.sys.parent)) for path in every if path.is_symlink() or not path.is_dir()}


def heard(loop, events):
    loop.run_for(1)
    said = [(event.action, event.subsystem, event.devpath.rpartition("/")[2]) for event in events]
    events.clear()
    return said


def test_the_kernel_tells_of_a_device_from_outside_to_inside_and_back(loop, machine, events):
    machine.plug(PLACE, MODEM)
    assert heard(loop, events) == [
        ("add", "usb", "1-1.3"),
        ("add", "usb", "1-1.3:1.0"),
        ("add", "net", "usb0"),
        ("bind", "usb", "1-1.3:1.0"),
        ("add", "usb", "1-1.3:1.4"),
        ("add", "usb-serial", "ttyUSB0"),
        ("add", "tty", "ttyUSB0"),
        ("bind", "usb", "1-1.3:1.4"),
    ]
    machine.unplug(PLACE)
    assert heard(loop, events) == [
        ("remove", "tty", "ttyUSB0"),
        ("remove", "usb-serial", "ttyUSB0"),
        ("remove", "usb", "1-1.3:1.4"),
        ("remove", "net", "usb0"),
        ("remove", "usb", "1-1.3:1.0"),
        ("remove", "usb", "1-1.3"),
    ]


def test_every_uevent_of_a_device_has_its_place_and_the_kernels_properties(loop, machine, events):
    machine.plug(PLACE, MODEM)
    loop.run_for(1)
    assert {str(of_devpath(event.devpath)) for event in events} == {PLACE}
    first, tty = events[0], next(event for event in events if event.subsystem == "tty")
    assert first.properties["DEVTYPE"] == "usb_device"
    assert first.properties["PRODUCT"] == "1e0e/9011/100"
    assert first.properties["DEVNAME"] == "bus/usb/001/003"
    assert (tty.properties["MAJOR"], tty.properties["DEVNAME"]) == ("188", "ttyUSB0")
    numbers = [int(event.properties["SEQNUM"]) for event in events]
    assert numbers == list(range(numbers[0], numbers[0] + len(events)))


def test_nothing_is_left_of_what_was_unplugged(machine, root):
    before = files(root)
    machine.plug(PLACE, MODEM)
    machine.unplug(PLACE)
    machine.unplug(PLACE)
    assert files(root) == before


def test_a_port_leads_to_the_pty_that_plays_it(machine, root):
    near, far = pty.openpty()
    machine.plug(PLACE, SimulatedDevice("1546", "01a9", [SimulatedInterface(0, "cdc_acm", os.ttyname(far))]))
    opened = os.open(usb.tty(root, PLACE, 0), os.O_RDWR | os.O_NOCTTY)
    assert os.ttyname(opened) == os.ttyname(far)
    for descriptor in (near, far, opened):
        os.close(descriptor)


def test_hubs_behind_hubs_are_made(tmp_path):
    machine = SimulatedMachine(tmp_path, hub="2-1.2", ports=2)
    machine.plug("2-1.2.2", MODEM)
    assert [device.topology for device in usb.devices(machine.machine)] == ["2-1", "2-1.2", "2-1.2.2"]
    usb.hub_port(machine.machine, "2-1.2.2", False)
    machine.poll()
    assert [device.topology for device in usb.devices(machine.machine)] == ["2-1", "2-1.2"]
    machine.close()


# Supply.


def test_a_module_without_any_switch_is_supplied_at_once(module, root):
    assert module == [True]
    assert usb.find(root, PLACE).id == "1e0e:9011"


def test_a_module_waits_for_all_that_it_misses(machine):
    told = []
    machine.sit(PLACE, told.append, missing=["power", "release"])
    machine.supply(PLACE, "power", True)
    assert told == []
    machine.supply(PLACE, "release", True)
    machine.supply(PLACE, "release", True)
    assert told == [True]
    machine.supply(PLACE, "power", False)
    machine.supply(PLACE, "release", False)
    assert told == [True, False]


def test_a_module_is_gone_without_power(machine, module, root):
    machine.supply(PLACE, "power", False)
    assert module == [True, False]
    assert usb.find(root, PLACE) is None
    machine.plug(PLACE, MODEM)  # a timer of the module that came too late
    assert usb.find(root, PLACE) is None
    machine.supply(PLACE, "power", True)
    assert usb.find(root, PLACE).id == "1e0e:9011"


def test_a_module_is_gone_while_its_hubs_port_is_off(machine, module, root):
    for on in (False, True):
        usb.hub_port(root, PLACE, on)
        machine.poll()
        machine.poll()
        assert (usb.find(root, PLACE) is not None) is on
    assert module == [True, False, True]


def test_other_places_keep_their_supply(machine, module, root):
    usb.hub_port(root, "1-1.2", False)
    machine.poll()
    assert module == [True]


def test_a_module_loses_its_interfaces_and_stays_to_be_seen_while_it_is_not_authorized(machine, module, root):
    usb.authorize(root, PLACE, False)
    machine.poll()
    found = usb.find(root, PLACE)
    assert (found.is_authorized, found.interfaces) == (False, ())
    assert module == [True, False]
    machine.unplug(PLACE)  # a module that switches off takes itself away; the kernel's device stays
    assert usb.find(root, PLACE) is not None
    usb.authorize(root, PLACE, True)
    machine.poll()
    assert module == [True, False, True]
    assert usb.tty(root, PLACE, 4) == str(root.dev / "ttyUSB1")


def test_a_module_that_lost_its_power_too_is_authorized_when_it_is_back(machine, module, root):
    usb.authorize(root, PLACE, False)
    machine.poll()
    machine.supply(PLACE, "power", False)
    assert usb.find(root, PLACE) is None
    machine.supply(PLACE, "power", True)
    assert usb.find(root, PLACE).is_authorized
    assert module == [True, False, True]


def test_a_device_that_is_no_module_gets_its_interfaces_back(machine, root):
    machine.plug(PLACE, MODEM)
    for on in (False, True):
        usb.authorize(root, PLACE, on)
        machine.poll()
    assert usb.network_device(root, PLACE) == "usb0"


def test_a_file_that_is_just_being_written_changes_nothing(machine, module, root):
    usb.hub_port(root, PLACE, False)
    machine.poll()
    (root.sys / "bus/usb/devices/1-1:1.0/1-1-port3/disable").write_text("")
    machine.poll()
    assert module == [True, False]


def test_a_module_that_is_pulled_out_is_gone_and_told_once(machine, module, root):
    machine.leave(PLACE)
    machine.leave(PLACE)
    assert module == [True, False]
    assert usb.find(root, PLACE) is None


def test_a_module_that_is_pulled_out_while_it_has_no_supply_was_told_already(machine, module, root):
    usb.authorize(root, PLACE, False)
    machine.poll()
    machine.leave(PLACE)
    assert module == [True, False]
    assert usb.find(root, PLACE) is None
