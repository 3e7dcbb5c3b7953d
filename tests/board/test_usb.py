"""USB devices by place: on trees as Linux makes them, of the simulated machine and copied by hand."""

import errno
import fcntl
import os

import pytest

from board import sysfs, usb
from board.machine import Machine
from board.runtime.errors import ConfigurationError, InterfaceError
from board.usb import UsbDevice, UsbInterface
from drivers.sim.machine import SimulatedDevice, SimulatedInterface

MODEM = SimulatedDevice(
    "1e0e",
    "9001",
    [
        *(SimulatedInterface(number, "option", "/dev/null") for number in range(5)),
        SimulatedInterface(5, "qmi_wwan", "wwan0"),
    ],
    "SimTech, Incorporated",
    "SDXPRAIRIE-MTP",
)
RECEIVER = SimulatedDevice(
    "1546",
    "01a9",
    [SimulatedInterface(0, "cdc_acm", "/dev/null"), SimulatedInterface(1)],
    "u-blox AG - www.u-blox.com",
    "u-blox GNSS receiver",
    12,
)
RADIO = SimulatedDevice("0525", "a4a2", [SimulatedInterface(0, "rndis_host", "enx0200"), SimulatedInterface(1)])


@pytest.fixture
def root(machine):
    return machine.machine


@pytest.fixture
def copied(tmp_path):
    """A receiver at 1-1.1 in files written by hand, as `tar -c` of a Pi's sysfs has them, with configuration 2."""
    machine = Machine(tmp_path / "copy/sys", tmp_path / "copy/dev")
    folder = machine.sys / "devices/platform/scb/usb1/1-1/1-1.1"
    for name, text in {
        "busnum": "1",
        "devnum": "12",
        "idVendor": "1546",
        "idProduct": "01a9",
        "manufacturer": "u-blox AG \N{EM DASH} \0\x1b[31m",
        "product": "u-blox GNSS receiver",
        "serial": "0123456789",
        "speed": "unknown",
        "authorized": "1",
        "1-1.1:2.0/bInterfaceNumber": "00",
        "1-1.1:2.0/bInterfaceClass": "02",
        "1-1.1:2.0/tty/ttyACM0/dev": "166:0",
        "1-1.1:2.1/bInterfaceNumber": "01",
        "1-1.1:2.1/bInterfaceClass": "0a",
        "ep_00/type": "Control",
    }.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")
    devices = machine.sys / "bus/usb/devices"
    devices.mkdir(parents=True)
    for name in ("1-1.1", "1-1.1/1-1.1:2.0", "1-1.1/1-1.1:2.1"):
        (devices / name.rpartition("/")[2]).symlink_to(folder.parent / name)
    return machine


def test_a_device_is_what_sysfs_says_of_it(machine, root):
    machine.plug("1-1.1", RECEIVER)
    functions = (UsbInterface(0, 0x02, "cdc_acm"), UsbInterface(1, 0xFF, ""))
    found = UsbDevice("1-1.1", 3, "1546", "01a9", speed_mbit=12.0, is_authorized=True, interfaces=functions)
    assert usb.find(root, "1-1.1") == found
    words = {"manufacturer": "u-blox AG - www.u-blox.com", "title": "u-blox GNSS receiver"}
    assert usb.devices(root)[1] == found._replace(**words)


def test_a_device_names_itself(machine, root):
    machine.plug("1-1.1", RECEIVER)
    machine.plug("1-1.2", RADIO)
    _, receiver, radio = usb.devices(root)
    assert str(receiver) == "1546:01a9 (u-blox AG - www.u-blox.com u-blox GNSS receiver)"
    assert str(radio) == "0525:a4a2"


def test_nothing_is_read_on_the_loop_that_the_kernel_gives_only_when_it_is_done_with_a_device(
    machine, root, monkeypatch
):
    # usb_string_attr() of drivers/usb/core/sysfs.c takes the device's lock.
    machine.plug("1-1.1", RECEIVER)
    read = []
    text = sysfs.text
    monkeypatch.setattr(sysfs, "text", lambda path: read.append(path.name) or text(path))
    usb.find(root, "1-1.1")
    assert {"devnum", "idVendor"} <= set(read)
    assert not {"manufacturer", "product", "serial", "bConfigurationValue"} & set(read)


def test_an_empty_place_has_no_device(root):
    assert usb.find(root, "1-1.1") is None


def test_what_is_no_place_is_refused(root):
    with pytest.raises(ConfigurationError, match="is not the place"):
        usb.find(root, "../../../etc")


def test_all_devices_are_listed_by_place_without_root_hubs(machine, root):
    machine.plug("1-1.3", MODEM)
    machine.plug("1-1.1", RECEIVER)
    assert [device.topology for device in usb.devices(root)] == ["1-1", "1-1.1", "1-1.3"]


def test_a_machine_without_usb_has_no_devices(tmp_path):
    nothing = Machine(tmp_path / "sys", tmp_path / "dev")
    assert usb.devices(nothing) == []
    assert usb.find(nothing, "1-1") is None


def test_what_a_device_says_of_itself_is_shown_without_what_does_not_print(copied):
    (device,) = usb.devices(copied)
    assert device.manufacturer == "u-blox AG \N{EM DASH} [31m"
    assert device.speed_mbit == 0.0


def test_the_serial_number_of_a_device_is_nowhere(copied):
    assert "0123456789" not in repr(usb.devices(copied))


def test_a_device_that_goes_while_it_is_read_is_none(copied):
    (copied.sys / "bus/usb/devices/1-1.1/devnum").write_text("")
    assert usb.find(copied, "1-1.1") is None
    (copied.sys / "bus/usb/devices/1-1.1/devnum").unlink()
    assert usb.find(copied, "1-1.1") is None
    assert usb.devices(copied) == []


# Ports and network devices.


def test_a_port_is_found_by_its_interface_and_not_by_its_number(machine, root):
    machine.plug("1-1.3", MODEM)
    assert usb.tty(root, "1-1.3", 2) == str(root.dev / "ttyUSB2")
    machine.plug("1-1.3", MODEM)
    assert usb.tty(root, "1-1.3", 2) == str(root.dev / "ttyUSB7")
    machine.plug("1-1.3", MODEM)
    assert usb.tty(root, "1-1.3", 2) == str(root.dev / "ttyUSB12")


def test_two_modems_keep_their_ports_apart(machine, root):
    machine.plug("1-1.4", MODEM)
    machine.plug("1-1.3", MODEM._replace(interfaces=MODEM.interfaces[:5]))
    assert usb.tty(root, "1-1.4", 2) == str(root.dev / "ttyUSB2")
    assert usb.tty(root, "1-1.3", 2) == str(root.dev / "ttyUSB7")


def test_a_port_of_cdc_acm_is_found(machine, root, copied):
    machine.plug("1-1.1", RECEIVER)
    assert usb.tty(root, "1-1.1", 0) == str(root.dev / "ttyACM0")
    assert usb.tty(copied, "1-1.1", 0) == str(copied.dev / "ttyACM0")


def test_network_device_and_control_port_are_found(machine, root):
    machine.plug("1-1.3", MODEM)
    machine.plug("1-1.2", RADIO)
    assert usb.network_device(root, "1-1.3") == "wwan0"
    assert usb.network_device(root, "1-1.2") == "enx0200"
    assert usb.control_device(root, "1-1.3") == str(root.dev / "cdc-wdm0")


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda root: usb.tty(root, "1-1.4", 2), "no USB device at 1-1.4"),
        (lambda root: usb.network_device(root, "1-1.4"), "no USB device at 1-1.4"),
        (lambda root: usb.tty(root, "1-1.1", 7), "USB device 1-1.1 has no interface 7, but 0, 1"),
        (lambda root: usb.tty(root, "1-1.1", 1), "USB device 1-1.1: interface 1 is not a serial port"),
        (lambda root: usb.tty(root, "1-1.3", 5), "USB device 1-1.3: interface 5 is not a serial port"),
        (lambda root: usb.network_device(root, "1-1.1"), "USB device 1-1.1 has no network device"),
        (lambda root: usb.control_device(root, "1-1.1"), "USB device 1-1.1 has no control port for QMI or MBIM"),
    ],
)
def test_what_is_not_there_is_named(machine, root, ask, message):
    machine.plug("1-1.1", RECEIVER)
    machine.plug("1-1.3", MODEM)
    with pytest.raises(InterfaceError) as caught:
        ask(root)
    assert caught.value.message == message
    assert caught.value.hint


def test_a_device_that_is_not_authorized_says_so(machine, root):
    machine.plug("1-1.3", MODEM)
    usb.authorize(root, "1-1.3", False)
    machine.poll()
    assert not usb.find(root, "1-1.3").is_authorized
    with pytest.raises(InterfaceError, match=r"1-1\.3 is not authorized"):
        usb.tty(root, "1-1.3", 2)


# What switches.


@pytest.mark.parametrize("on", [False, True])
def test_authorized_is_written(machine, root, on):
    machine.plug("1-1.3", MODEM)
    usb.authorize(root, "1-1.3", on)
    assert sysfs.text(root.sys / "bus/usb/devices/1-1.3/authorized") == f"{on:d}"


@pytest.mark.parametrize(
    ("place", "path"),
    [("1-1.3", "1-1:1.0/1-1-port3"), ("1-1", "usb1/1-0:1.0/usb1-port1")],
)
def test_the_port_of_a_hub_is_switched_even_of_a_root_hub(root, place, path):
    port = root.sys / "bus/usb/devices" / path / "disable"
    usb.hub_port(root, place, False)
    assert sysfs.text(port) == "1"
    usb.hub_port(root, place, True)
    assert sysfs.text(port) == "0"


def test_the_superspeed_twin_of_a_port_is_switched_too(root):
    twin = root.sys / "devices/platform/usb2/2-1/2-1:1.0/2-1-port3"
    twin.mkdir(parents=True)
    (twin / "disable").write_text("0\n")
    (root.sys / "bus/usb/devices/1-1:1.0/1-1-port3/peer").symlink_to(twin)
    usb.hub_port(root, "1-1.3", False)
    assert sysfs.text(twin / "disable") == "1"


def test_a_hub_that_is_not_there_or_too_small_is_named(root):
    with pytest.raises(InterfaceError, match=r"port 1 of USB hub 1-2: no such hub"):
        usb.hub_port(root, "1-2.1", False)
    with pytest.raises(InterfaceError, match=r"port 5 of USB hub 1-1: it has 4 ports"):
        usb.hub_port(root, "1-1.5", False)


def test_a_kernel_that_cannot_switch_ports_is_named(root):
    (root.sys / "bus/usb/devices/1-1:1.0/1-1-port3/disable").unlink()
    with pytest.raises(InterfaceError, match=r"Linux 6\.0"):
        usb.hub_port(root, "1-1.3", False)


def test_a_hub_whose_port_stays_as_it_was_does_not_switch_it(root, monkeypatch):
    monkeypatch.setattr(sysfs, "switch", lambda path, is_on: None)
    with pytest.raises(InterfaceError, match="cannot switch the power of a single port") as caught:
        usb.hub_port(root, "1-1.3", False)
    assert "hub_port = false" in caught.value.hint


def refusing(number):
    def refuse(*arguments):
        raise OSError(number, os.strerror(number))

    return refuse


@pytest.mark.parametrize(
    ("number", "message", "hint"),
    [
        (errno.EACCES, "not permitted", "run it as root"),
        (errno.EPERM, "not permitted", "run it as root"),
        (errno.EROFS, "not permitted", "run it as root"),
        (errno.ENODEV, "the device is gone", "lsusb"),
        (errno.EIO, "input/output error", "dmesg"),
        (errno.ETIMEDOUT, "connection timed out", "dmesg"),
    ],
)
def test_what_the_kernel_refuses_has_a_remedy(machine, root, monkeypatch, number, message, hint):
    machine.plug("1-1.3", MODEM)
    monkeypatch.setattr(sysfs, "switch", refusing(number))
    for act, what in (
        (usb.authorize, "USB device 1-1.3: authorized = 0"),
        (usb.hub_port, "port 3 of USB hub 1-1: power off"),
    ):
        with pytest.raises(InterfaceError) as caught:
            act(root, "1-1.3", False)
        assert caught.value.message == f"{what}: {message}"
        assert hint in caught.value.hint


def test_a_hub_that_stalls_does_not_switch_ports(root, monkeypatch):
    monkeypatch.setattr(sysfs, "switch", refusing(errno.EPIPE))
    with pytest.raises(InterfaceError, match="cannot switch the power of a single port"):
        usb.hub_port(root, "1-1.3", False)


@pytest.mark.parametrize(
    "act", [lambda root: usb.authorize(root, "1-1.4", True), lambda root: usb.reset(root, "1-1.4")]
)
def test_nothing_is_done_to_a_device_that_is_not_there(root, act):
    with pytest.raises(InterfaceError, match=r"no USB device at 1-1\.4"):
        act(root)


def test_a_reset_is_asked_of_the_node_of_the_device(machine, root, monkeypatch):
    machine.plug("1-1.3", MODEM)
    asked = []
    monkeypatch.setattr(
        fcntl, "ioctl", lambda where, what, value: asked.append((os.readlink(f"/proc/self/fd/{where}"), what))
    )
    usb.reset(root, "1-1.3")
    assert asked == [(str(root.dev / "bus/usb/001/003"), 0x5514)]


def test_a_device_that_is_another_one_after_its_reset_was_reset(machine, root, monkeypatch):
    machine.plug("1-1.3", MODEM)
    monkeypatch.setattr(fcntl, "ioctl", refusing(errno.ENODEV))
    usb.reset(root, "1-1.3")


def test_a_reset_that_is_refused_is_told_and_leaves_no_descriptor(machine, root, monkeypatch):
    machine.plug("1-1.3", MODEM)
    before = os.listdir("/proc/self/fd")
    with pytest.raises(InterfaceError, match=r"1-1\.3: reset: inappropriate ioctl"):  # a plain file
        usb.reset(root, "1-1.3")
    assert os.listdir("/proc/self/fd") == before
    monkeypatch.setattr(os, "open", refusing(errno.EACCES))
    with pytest.raises(InterfaceError, match=r"1-1\.3: reset: not permitted"):
        usb.reset(root, "1-1.3")
