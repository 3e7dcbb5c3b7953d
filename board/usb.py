"""USB devices by place: identity, ttys, network device and power.

The names of ttys change with each re-plugging; the place and the interface number do not.
Source: the kernel's Documentation/ABI/testing/sysfs-bus-usb.
"""

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from board import sysfs
from board.machine import Machine
from board.runtime.errors import ConfigurationError, InterfaceError
from board.topology import parse

USBDEVFS_RESET = 0x5514  # _IO('U', 20) of linux/usbdevice_fs.h

SHOW = "see `lsusb -t`"


class UsbInterface(NamedTuple):
    """One interface (function) of a device.

    number  bInterfaceNumber, which data sheets use.
    kind    bInterfaceClass: 0xff vendor-specific, 0x02 communication, 0x0a data of communication.
    driver  name of the kernel driver; empty if none is bound.
    """

    number: int
    kind: int
    driver: str


class UsbDevice(NamedTuple):
    """USB device. Its serial number is not read, because a modem's may identify the owner.

    topology       its port: `1-1.3`.
    number         number given by the kernel at each plugging.
    vendor         vendor id, four hexadecimal digits.
    product        product id, four hexadecimal digits.
    manufacturer   manufacturer as the device reports it; empty in find(), because reading it may block.
    title          product name as the device reports it; empty in find().
    speed_mbit     480.0 for high speed; 0.0 if the kernel does not know.
    is_authorized  False: the kernel sees the device, but uses none of its interfaces.
    interfaces     its interfaces.
    """

    topology: str
    number: int
    vendor: str
    product: str
    manufacturer: str = ""
    title: str = ""
    speed_mbit: float = 0.0
    is_authorized: bool = True
    interfaces: tuple[UsbInterface, ...] = ()

    @property
    def id(self) -> str:
        """Vendor and product id in the form of a slot's ids: `1546:01a9`."""
        return f"{self.vendor}:{self.product}"

    def __str__(self) -> str:
        words = f"{self.manufacturer} {self.title}".strip()
        return f"{self.id} ({words})" if words else self.id


def find(machine: Machine, topology: str) -> UsbDevice | None:
    """Return the device at a port, without its texts; None if absent. Raises ConfigurationError for an invalid port."""
    return _read(_devices(machine) / str(parse(topology)))


def devices(machine: Machine) -> list[UsbDevice]:
    """Return all plugged devices and hubs, sorted by port, with their texts; without root hubs.

    Not for the loop: the texts block while the kernel resets or configures a device, which may take seconds.
    """
    places = []
    with suppress(OSError):  # the machine has no USB
        for name in os.listdir(_devices(machine)):
            with suppress(ConfigurationError):  # the name is that of an interface or a root hub
                places.append(parse(name))
    found = (_read(_devices(machine) / str(one)) for one in sorted(places))
    return [_with_words(machine, device) for device in found if device is not None]


def tty(machine: Machine, topology: str, interface_number: int) -> str:
    """Return the path of the serial port of an interface. Raises InterfaceError if it has none yet."""
    # usb-serial drivers (option) add a port: 1-1.3:1.2/ttyUSB2/tty/ttyUSB2; cdc_acm has 1-1.3:1.0/tty/ttyACM0.
    folder = _interface(machine, topology, interface_number)
    names = [*_names(folder, "tty/tty*"), *_names(folder, "tty*/tty/tty*")]
    if not names:
        raise _unbound(topology, f"interface {interface_number}", "serial port", folder)
    return str(machine.dev / names[0])


def network_device(machine: Machine, topology: str) -> str:
    """Return the name of the network device of a USB device. Raises InterfaceError if it has none yet."""
    return _below(machine, topology, "net/*", "network device")


def control_device(machine: Machine, topology: str) -> str:
    """Return the path of a modem's port for QMI or MBIM: /dev/cdc-wdm0. Raises InterfaceError if it has none yet."""
    return str(machine.dev / _below(machine, topology, "usbmisc/cdc-wdm*", "control port for QMI or MBIM"))


# The following functions block, with some hubs for seconds: only the board process may call them.


def authorize(machine: Machine, topology: str, on: bool) -> None:
    """Let the kernel use a device, or detach it from all drivers.

    Raises InterfaceError if no device is at the port, or the kernel refuses.
    """
    folder = _present(machine, topology)
    try:
        sysfs.switch(folder / "authorized", on)
    except OSError as error:
        raise _refused(f"USB device {topology}: authorized = {on:d}", error) from error


def reset(machine: Machine, topology: str) -> None:
    """Reset a device by its hub; the device may reappear as another one.

    Raises InterfaceError if no device is at the port, or the kernel refuses.
    """
    folder = _present(machine, topology)
    try:
        node = machine.dev / f"bus/usb/{int(sysfs.text(folder / 'busnum')):03}/{int(sysfs.text(folder / 'devnum')):03}"
        descriptor = os.open(node, os.O_WRONLY | os.O_CLOEXEC)
    except OSError as error:
        raise _refused(f"USB device {topology}: reset", error) from error
    try:
        fcntl.ioctl(descriptor, USBDEVFS_RESET, 0)
    except OSError as error:
        # ENODEV: the device was reset and changed, so the kernel removes it and detects it again.
        if error.errno != errno.ENODEV:
            raise _refused(f"USB device {topology}: reset", error) from error
    finally:
        os.close(descriptor)


def hub_port(machine: Machine, topology: str, on: bool) -> None:
    """Switch the supply of a hub's port and of its SuperSpeed twin, which feeds the same socket.

    Raises InterfaceError if the hub or port is absent, the kernel refuses, or the port does not change.
    """
    one = parse(topology)
    hub = _devices(machine) / one.hub_interface
    port = hub / f"{one.hub}-port{one.port}"
    what = f"port {one.port} of USB hub {one.hub}"
    if not hub.is_dir():
        raise InterfaceError(f"{what}: no such hub", SHOW)
    if not port.is_dir():
        ports = len(list(hub.glob(f"{one.hub}-port*")))
        raise InterfaceError(f"{what}: it has {ports} ports", "correct usb of the slot in the board file")
    for each in filter(Path.is_dir, (port, port / "peer")):
        _switch(each / "disable", on, f"{what}: power {'on' if on else 'off'}")


def _switch(path: Path, on: bool, what: str) -> None:
    if not path.exists():
        raise InterfaceError(f"{what}: the kernel has no {path.name} for USB ports", "use Linux 6.0 or later")
    try:
        sysfs.switch(path, not on)
        is_on = sysfs.text(path) == "0"
    except OSError as error:
        if error.errno == errno.EPIPE:  # stall: the hub does not support the request
            raise _not_switched(what) from error
        raise _refused(what, error) from error
    if is_on is not on:
        raise _not_switched(what)


def _not_switched(what: str) -> InterfaceError:
    hint = "set hub_port = false for the slot; the station then uses `authorized`; see `lsusb -v` of the hub"
    return InterfaceError(f"{what}: the hub cannot switch the power of a single port", hint)


def _refused(what: str, error: OSError) -> InterfaceError:
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return InterfaceError(
            f"{what}: not permitted", "give the station's user write access to /sys and /dev/bus/usb, or run it as root"
        )
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return InterfaceError(f"{what}: the device is gone", SHOW)
    return InterfaceError(f"{what}: {os.strerror(error.errno or 0).lower()}", "see `dmesg`")


# Readers of sysfs: each file may disappear between two reads.


def _devices(machine: Machine) -> Path:
    return machine.sys / "bus/usb/devices"


def _present(machine: Machine, topology: str) -> Path:
    folder = _devices(machine) / str(parse(topology))
    if not folder.is_dir():
        raise InterfaceError(f"no USB device at {topology}", f"check that the slot has power and its module; {SHOW}")
    return folder


def _read(folder: Path) -> UsbDevice | None:
    try:
        return UsbDevice(
            folder.name,
            int(sysfs.text(folder / "devnum")),
            sysfs.text(folder / "idVendor"),
            sysfs.text(folder / "idProduct"),
            speed_mbit=_speed(sysfs.optional(folder / "speed")),
            is_authorized=sysfs.optional(folder / "authorized") != "0",
            interfaces=tuple(sorted(UsbInterface(number, *_function(path)) for number, path in _interfaces(folder))),
        )
    except (OSError, ValueError):  # ValueError: a read during unplugging may return an empty text
        return None


def _with_words(machine: Machine, device: UsbDevice) -> UsbDevice:
    folder = _devices(machine) / device.topology
    manufacturer, title = sysfs.optional(folder / "manufacturer"), sysfs.optional(folder / "product")
    return device._replace(manufacturer=manufacturer, title=title)


def _interfaces(folder: Path) -> Iterator[tuple[int, Path]]:
    """Yield bInterfaceNumber and folder of each interface of a device."""
    for name in os.listdir(folder):
        if name.startswith(f"{folder.name}:"):
            with suppress(OSError, ValueError):
                yield int(sysfs.text(folder / name / "bInterfaceNumber"), 16), folder / name


def _function(folder: Path) -> tuple[int, str]:
    driver = folder / "driver"
    return int(sysfs.text(folder / "bInterfaceClass"), 16), driver.resolve().name if driver.exists() else ""


def _interface(machine: Machine, topology: str, number: int) -> Path:
    device = _present(machine, topology)
    try:
        found = dict(_interfaces(device))
    except OSError as error:
        raise _refused(f"USB device {topology}", error) from error
    if number not in found:
        if sysfs.optional(device / "authorized") == "0":
            raise InterfaceError(f"USB device {topology} is not authorized", "write 1 to its `authorized`, or cycle it")
        there = ", ".join(map(str, sorted(found))) or "none"
        raise InterfaceError(
            f"USB device {topology} has no interface {number}, but {there}", "check that it is the right device"
        )
    return found[number]


def _below(machine: Machine, topology: str, pattern: str, what: str) -> str:
    device = _present(machine, topology)
    names = _names(device, f"{topology}:*/{pattern}")
    if not names:
        raise InterfaceError(
            f"USB device {topology} has no {what}", "its driver may still be starting; `lsusb -t` shows it"
        )
    return names[0]


def _names(folder: Path, pattern: str) -> list[str]:
    """Return the names that match a pattern, ttyUSB9 before ttyUSB10."""
    with suppress(OSError):
        return sorted((path.name for path in folder.glob(pattern)), key=lambda name: (len(name), name))
    return []


def _unbound(topology: str, which: str, what: str, folder: Path) -> InterfaceError:
    driver = folder / "driver"
    why = f"its driver is {driver.resolve().name}" if driver.exists() else "no driver is bound to it"
    return InterfaceError(f"USB device {topology}: {which} is not a {what}", f"{why}; see `dmesg`")


def _speed(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0
