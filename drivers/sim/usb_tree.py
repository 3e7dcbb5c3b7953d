"""USB devices as Linux shows them: hubs with ports, devices, interfaces, and the devices of interfaces' drivers."""

import itertools
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from board.topology import Topology
from drivers.sim.kobjects import Kobject, Kobjects

# As on a Pi 4, where a VL805 on PCI Express has the USB sockets.
CONTROLLER = "devices/platform/scb/fd500000.pcie/pci0000:00/0000:00:00.0/0000:01:00.0"


class DriverKind(NamedTuple):
    """Devices that a kernel driver creates for an interface.

    kind  bInterfaceClass.
    tty   prefix and major number of its serial port.
    """

    kind: int
    tty: tuple[str, int] | None = None
    has_network: bool = False
    has_control: bool = False


DRIVERS = {
    "": DriverKind(0xFF),  # no driver is bound
    "option": DriverKind(0xFF, tty=("ttyUSB", 188)),
    "cdc_acm": DriverKind(0x02, tty=("ttyACM", 166)),
    "qmi_wwan": DriverKind(0xFF, has_network=True, has_control=True),
    "cdc_mbim": DriverKind(0x02, has_network=True, has_control=True),
    "rndis_host": DriverKind(0xE0, has_network=True),
    "cdc_ncm": DriverKind(0x02, has_network=True),
}


class SimulatedInterface(NamedTuple):
    """Interface of a simulated USB device.

    number  bInterfaceNumber.
    driver  key of DRIVERS.
    target  simulator of the interface: path of a pty for a serial port, or name of a network device.
    """

    number: int
    driver: str = ""
    target: str = ""


class SimulatedDevice(NamedTuple):
    """USB device that a module plugs in; vendor and product are four hexadecimal digits."""

    vendor: str
    product: str
    interfaces: Sequence[SimulatedInterface] = ()
    manufacturer: str = ""
    title: str = ""
    speed_mbit: int = 480


class UsbTree:
    """USB devices of one bus."""

    def __init__(self, kernel: Kobjects) -> None:
        self._kernel = kernel
        self._numbers = itertools.count(1)
        self._names: defaultdict[str, Iterator[int]] = defaultdict(itertools.count)

    def plant(self, hub: Topology, ports: int) -> dict[Topology, Path]:
        """Create the root hub, the hubs above, and the hub itself; return the folders of its ports."""
        above = [Topology(hub.bus, hub.ports[:level]) for level in range(1, len(hub.ports) + 1)]
        self._hub(f"usb{hub.bus}", self._bus(hub), f"{hub.bus}-0:1.0", hub.ports[0])
        for one, below in zip(above, (*hub.ports[1:], ports), strict=True):
            interface = self._hub(str(one), self._folder(one), f"{one}:1.0", below)
        own = (Topology(hub.bus, (*hub.ports, number)) for number in range(1, ports + 1))
        return {port: interface / f"{hub}-port{port.port}" for port in own}

    def enumerate(self, place: Topology, device: SimulatedDevice) -> Kobject:
        """Create a device without its interfaces."""
        return self._device(str(place), self._folder(place), place.bus, device, "00")

    def configure(self, one: Kobject, device: SimulatedDevice) -> Iterator[Kobject]:
        """Create the interfaces of a device, with the devices of their drivers; yield them in order of creation."""
        for interface in device.interfaces:
            yield from self._interface(one.folder, interface)

    def _hub(self, name: str, folder: Path, interface: str, ports: int) -> Path:
        """Create a hub with its ports; return the folder of its interface, which contains the ports."""
        device = SimulatedDevice("1d6b", "0002", (), "Linux Foundation", "simulated hub")
        self._device(name, folder, int(interface.partition("-")[0]), device, "09")
        attributes = {"bInterfaceNumber": "00", "bInterfaceClass": "09"}
        found_at = f"bus/usb/devices/{interface}"
        self._kernel.add(folder / interface, "usb", attributes, found_at, DEVTYPE="usb_interface")
        for number in range(1, ports + 1):
            port = folder / interface / f"{name}-port{number}"
            port.mkdir()
            (port / "disable").write_text("0\n")
        return folder / interface

    def _device(self, name: str, folder: Path, bus: int, device: SimulatedDevice, kind: str) -> Kobject:
        number = next(self._numbers)
        attributes: dict[str, object] = {
            "busnum": bus,
            "devnum": number,
            "idVendor": device.vendor,
            "idProduct": device.product,
            "bDeviceClass": kind,
            "speed": device.speed_mbit,
            "authorized": 1,
        }
        words = {"manufacturer": device.manufacturer, "product": device.title}
        return self._kernel.add(
            folder,
            "usb",
            attributes | {key: text for key, text in words.items() if text},
            f"bus/usb/devices/{name}",
            (f"bus/usb/{bus:03}/{number:03}", ""),
            DEVTYPE="usb_device",
            PRODUCT=f"{int(device.vendor, 16):x}/{int(device.product, 16):x}/100",
            BUSNUM=f"{bus:03}",
            DEVNUM=f"{number:03}",
        )

    def _interface(self, device: Path, interface: SimulatedInterface) -> Iterator[Kobject]:
        kind = DRIVERS[interface.driver]
        name = f"{device.name}:1.{interface.number}"
        folder = device / name
        attributes = {"bInterfaceNumber": f"{interface.number:02x}", "bInterfaceClass": f"{kind.kind:02x}"}
        properties = {"DEVTYPE": "usb_interface", "INTERFACE": f"{kind.kind}/0/0"}
        made = self._kernel.add(folder, "usb", attributes, f"bus/usb/devices/{name}", **properties)
        yield made
        if kind.tty is not None:
            yield from self._tty(folder, *kind.tty, interface.target)
        if kind.has_network:
            name = interface.target
            yield self._kernel.add(folder / "net" / name, "net", {}, f"class/net/{name}", INTERFACE=name)
        if kind.has_control:
            name = f"cdc-wdm{next(self._names['cdc-wdm'])}"
            yield self._kernel.add(folder / "usbmisc" / name, "usbmisc", {}, f"class/usbmisc/{name}", (name, ""))
        if interface.driver:
            self._kernel.bind(made, interface.driver)

    def _tty(self, folder: Path, prefix: str, major: int, target: str) -> Iterator[Kobject]:
        # No number is used twice. The kernel does the same while a program keeps the old port open.
        number = next(self._names[prefix])
        name = f"{prefix}{number}"
        if prefix == "ttyUSB":  # usb-serial has a bus of its own between interface and tty
            folder = folder / name
            yield self._kernel.add(folder, "usb-serial", {}, f"bus/usb-serial/devices/{name}")
        properties = {"MAJOR": str(major), "MINOR": str(number)}
        yield self._kernel.add(folder / "tty" / name, "tty", {}, f"class/tty/{name}", (name, target), **properties)

    def _folder(self, one: Topology) -> Path:
        above = (str(Topology(one.bus, one.ports[:level])) for level in range(1, len(one.ports) + 1))
        return self._bus(one).joinpath(*above)

    def _bus(self, one: Topology) -> Path:
        return self._kernel.sys / CONTROLLER / f"usb{one.bus}"
