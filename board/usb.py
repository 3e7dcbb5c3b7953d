"""USB devices by the place they are plugged in: what sits there, its ttys and network device; and its power.

Names of ttys change with each re-plugging and say nothing of the slot; place and interface number do not change.
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
from board import topology as place
from board.errors import ConfigurationError, InterfaceError
from board.machine import Machine

USBDEVFS_RESET = 0x5514  # _IO('U', 20) of linux/usbdevice_fs.h

SHOW = "`lsusb -t` shows what is plugged in where"


class UsbInterface(NamedTuple):
    """One function of a device.

    number  bInterfaceNumber: what a data sheet calls it by.
    kind    bInterfaceClass: 0xff is the vendor's own, 0x02 communication, 0x0a its data.
    driver  the kernel's, empty while none is bound.
    """

    number: int
    kind: int
    driver: str


class Device(NamedTuple):
    """A USB device. Its serial number is not read: with a modem it may tell the owner.

    topology       where it is: `1-1.3`.
    number         the kernel's, another one each time that it is plugged in.
    vendor         four hexadecimal digits, product too.
    manufacturer   what it says itself, title too; may be empty, and is where nobody may wait for it.
    speed_mbit     480.0 for high speed; 0.0 where the kernel does not know.
    is_authorized  False: the kernel sees it, and uses nothing of it.
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
        """`1546:01a9`, as a slot's ids have it."""
        return f"{self.vendor}:{self.product}"

    def __str__(self) -> str:
        words = f"{self.manufacturer} {self.title}".strip()
        return f"{self.id} ({words})" if words else self.id


def find(machine: Machine, topology: str) -> Device | None:
    """The device at a place, without its words; None where none is. Raises ConfigurationError for what is no place."""
    return _read(_devices(machine) / str(place.parse(topology)))


def devices(machine: Machine) -> list[Device]:
    """All that are plugged in, hubs too, by place, with their words; root hubs are a part of the machine.

    Not for the loop: the kernel gives no words of a device while it resets or configures it, which may take seconds.
    """
    places = []
    with suppress(OSError):  # a machine without USB
        for name in os.listdir(_devices(machine)):
            with suppress(ConfigurationError):  # an interface or a root hub
                places.append(place.parse(name))
    found = (_read(_devices(machine) / str(one)) for one in sorted(places))
    return [_with_words(machine, device) for device in found if device is not None]


def tty(machine: Machine, topology: str, interface_number: int) -> str:
    """Path of the serial port that an interface of a device is. Raises InterfaceError while there is none."""
    # usb-serial drivers (option) have a port between: 1-1.3:1.2/ttyUSB2/tty/ttyUSB2; cdc_acm has 1-1.3:1.0/tty/ttyACM0.
    folder = _interface(machine, topology, interface_number)
    names = [*_names(folder, "tty/tty*"), *_names(folder, "tty*/tty/tty*")]
    if not names:
        raise _unbound(topology, f"interface {interface_number}", "serial port", folder)
    return str(machine.dev / names[0])


def network_device(machine: Machine, topology: str) -> str:
    """Name of the network device that a device is. Raises InterfaceError while there is none."""
    return _below(machine, topology, "net/*", "network device")


def control_device(machine: Machine, topology: str) -> str:
    """Path of the port where a modem takes QMI or MBIM: /dev/cdc-wdm0. Raises InterfaceError while there is none."""
    return str(machine.dev / _below(machine, topology, "usbmisc/cdc-wdm*", "control port for QMI or MBIM"))


# What follows blocks, for seconds with some hubs: it is for the board's worker alone.


def authorize(machine: Machine, topology: str, on: bool) -> None:
    """Let the kernel use a device, or take it away from all drivers. Raises InterfaceError."""
    folder = _present(machine, topology)
    try:
        sysfs.switch(folder / "authorized", on)
    except OSError as error:
        raise _refused(f"USB device {topology}: authorized = {on:d}", error) from error


def reset(machine: Machine, topology: str) -> None:
    """Reset a device as its hub can; it may come back as a new one. Raises InterfaceError."""
    folder = _present(machine, topology)
    try:
        node = machine.dev / f"bus/usb/{int(sysfs.text(folder / 'busnum')):03}/{int(sysfs.text(folder / 'devnum')):03}"
        descriptor = os.open(node, os.O_WRONLY | os.O_CLOEXEC)
    except OSError as error:
        raise _refused(f"USB device {topology}: reset", error) from error
    try:
        fcntl.ioctl(descriptor, USBDEVFS_RESET, 0)
    except OSError as error:
        # ENODEV: reset, and not the same afterwards: the kernel takes it away and looks for it anew.
        if error.errno != errno.ENODEV:
            raise _refused(f"USB device {topology}: reset", error) from error
    finally:
        os.close(descriptor)


def hub_port(machine: Machine, topology: str, on: bool) -> None:
    """Switch the supply of a hub's port, and of its SuperSpeed twin, which feeds the same socket.

    Raises InterfaceError, also where the hub took it and its port is as before.
    """
    one = place.parse(topology)
    hub = _devices(machine) / one.hub_interface
    port = hub / f"{one.hub}-port{one.port}"
    what = f"port {one.port} of USB hub {one.hub}"
    if not hub.is_dir():
        raise InterfaceError(f"{what}: there is no such hub", SHOW)
    if not port.is_dir():
        ports = len(list(hub.glob(f"{one.hub}-port*")))
        raise InterfaceError(f"{what}: it has {ports} ports", "correct usb of the slot in the board file")
    for each in filter(Path.is_dir, (port, port / "peer")):
        _switch(each / "disable", on, f"{what}: power {'on' if on else 'off'}")


def _switch(path: Path, on: bool, what: str) -> None:
    if not path.exists():
        raise InterfaceError(f"{what}: the kernel has no {path.name} for ports", "it takes Linux 6.0 or later")
    try:
        sysfs.switch(path, not on)
        is_on = sysfs.text(path) == "0"
    except OSError as error:
        if error.errno == errno.EPIPE:  # a stall: the hub does not know the request
            raise _not_switched(what) from error
        raise _refused(what, error) from error
    if is_on is not on:
        raise _not_switched(what)


def _not_switched(what: str) -> InterfaceError:
    hint = "set hub_port = false for the slot: `authorized` is used then; `lsusb -v` of the hub says what it switches"
    return InterfaceError(f"{what}: the hub does not switch its ports one by one", hint)


def _refused(what: str, error: OSError) -> InterfaceError:
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return InterfaceError(
            f"{what}: not permitted", "run the station as root: it takes writing to /sys and /dev/bus/usb"
        )
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return InterfaceError(f"{what}: the device is gone", SHOW)
    return InterfaceError(f"{what}: {os.strerror(error.errno or 0).lower()}", "`dmesg` has the kernel's reason")


# Reading sysfs: whatever is there may be gone at the next look.


def _devices(machine: Machine) -> Path:
    return machine.sys / "bus/usb/devices"


def _present(machine: Machine, topology: str) -> Path:
    folder = _devices(machine) / str(place.parse(topology))
    if not folder.is_dir():
        raise InterfaceError(f"no USB device at {topology}", f"is the slot powered, is the module in it? {SHOW}")
    return folder


def _read(folder: Path) -> Device | None:
    try:
        return Device(
            folder.name,
            int(sysfs.text(folder / "devnum")),
            sysfs.text(folder / "idVendor"),
            sysfs.text(folder / "idProduct"),
            speed_mbit=_speed(sysfs.optional(folder / "speed")),
            is_authorized=sysfs.optional(folder / "authorized") != "0",
            interfaces=tuple(sorted(UsbInterface(number, *_function(path)) for number, path in _interfaces(folder))),
        )
    except (OSError, ValueError):  # ValueError: empty, as a read in the moment of unplugging may be
        return None


def _with_words(machine: Machine, device: Device) -> Device:
    folder = _devices(machine) / device.topology
    manufacturer, title = sysfs.optional(folder / "manufacturer"), sysfs.optional(folder / "product")
    return device._replace(manufacturer=manufacturer, title=title)


def _interfaces(folder: Path) -> Iterator[tuple[int, Path]]:
    """bInterfaceNumber and folder of each interface of a device."""
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
        raise InterfaceError(f"USB device {topology} has no interface {number}, but {there}", "is it the right device?")
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
    """What a pattern finds, ttyUSB9 before ttyUSB10."""
    with suppress(OSError):
        return sorted((path.name for path in folder.glob(pattern)), key=lambda name: (len(name), name))
    return []


def _unbound(topology: str, which: str, what: str, folder: Path) -> InterfaceError:
    driver = folder / "driver"
    why = f"its driver is {driver.resolve().name}" if driver.exists() else "no driver is bound to it"
    return InterfaceError(f"USB device {topology}: {which} is no {what}", f"{why}; `dmesg` says what was tried")


def _speed(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0
