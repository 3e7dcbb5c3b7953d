"""Place of a USB device: bus and hub ports, such as `1-1.3`."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from board.runtime.errors import ConfigurationError

# No number begins with 0; this also excludes I2C devices (`1-0050`).
_NUMBER = "[1-9][0-9]{0,2}"
_TOPOLOGY = re.compile(rf"({_NUMBER})-({_NUMBER}(?:\.{_NUMBER})*)")
_ROOT_HUB = re.compile(rf"usb{_NUMBER}")

MOST_LEVELS = 6  # most ports in a row: seven tiers with the root hub (USB 2.0, 4.1.1); MAX_TOPO_LEVEL of the kernel
MOST_PORTS = 31  # most ports of a hub: USB_MAXCHILDREN of the kernel


class Topology(NamedTuple):
    """USB port: `1-1.3` is port 3 of the hub in port 1 of bus 1.

    bus    number of the bus, from 1.
    ports  port numbers from the root hub on: 1 to 6 of them, each 1 to 31.
    """

    bus: int
    ports: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.bus}-{'.'.join(map(str, self.ports))}"

    @property
    def port(self) -> int:
        """Number of the port at its hub."""
        return self.ports[-1]

    @property
    def hub(self) -> str:
        """Name of its hub in the kernel: `1-1`, or `usb1` for the root hub of bus 1."""
        above = self.ports[:-1]
        return str(Topology(self.bus, above)) if above else f"usb{self.bus}"

    @property
    def hub_interface(self) -> str:
        """Name of the hub's only interface in the kernel: `1-1:1.0`, or `1-0:1.0` for a root hub."""
        return f"{self.bus}-0:1.0" if len(self.ports) == 1 else f"{self.hub}:1.0"

    def holds(self, other: "Topology") -> bool:
        """Return whether `other` is this USB port or a port of a hub behind it; a module may contain a hub."""
        return self.bus == other.bus and other.ports[: len(self.ports)] == self.ports


def parse(text: str) -> Topology:
    """Parse a USB port of a board file: 1-1.3.

    Raises ConfigurationError if it is malformed, has more than MOST_LEVELS ports in a row, or a port above MOST_PORTS.
    """
    found = _TOPOLOGY.fullmatch(text)
    if found is None:
        raise ConfigurationError(
            f"{text!r} is not the place of a USB device",
            "bus-port.port as `ls /sys/bus/usb/devices` shows it: 1-1.3 is port 3 of the hub in port 1 of bus 1",
        )
    ports = tuple(map(int, found[2].split(".")))
    if len(ports) > MOST_LEVELS:
        raise ConfigurationError(f"{text!r}: {len(ports)} levels of ports", f"USB has {MOST_LEVELS} at most")
    if max(ports) > MOST_PORTS:
        raise ConfigurationError(f"{text!r}: port {max(ports)}", f"a hub has {MOST_PORTS} ports at most")
    return Topology(int(found[1]), ports)


def of_devpath(devpath: str) -> Topology | None:
    """Return the USB port of a sysfs path of a device, or of its interface, tty or network device; None if not USB."""
    deepest = None
    is_usb = False
    for part in devpath.split("/"):
        if is_usb and _TOPOLOGY.fullmatch(part):
            deepest = part
        is_usb = is_usb or _ROOT_HUB.fullmatch(part) is not None
    try:
        return parse(deepest) if deepest else None
    except ConfigurationError:
        return None


def holder(topology: Topology, places: Mapping[str, str]) -> str | None:
    """Return the name of the place that holds a port; of nested places, the nearest; None if no place holds it.

    places  topology text by name, as in slots; empty text: unknown.
    """
    held = {name: place for name, text in places.items() if text and (place := parse(text)).holds(topology)}
    return max(held, key=lambda name: len(held[name].ports), default=None)
