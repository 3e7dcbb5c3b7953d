"""Where a USB device is plugged in: its bus and the port of each hub on the way, `1-1.3`, as Linux names it."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from board.errors import ConfigurationError

# No number begins with 0, which also keeps I2C devices (`1-0050`) apart.
_NUMBER = "[1-9][0-9]{0,2}"
_TOPOLOGY = re.compile(rf"({_NUMBER})-({_NUMBER}(?:\.{_NUMBER})*)")
_ROOT_HUB = re.compile(rf"usb{_NUMBER}")

MOST_LEVELS = 6  # ports in a row: USB 2.0, 4.1.1, seven tiers with the root hub; MAX_TOPO_LEVEL of the kernel
MOST_PORTS = 31  # of a hub: USB_MAXCHILDREN of the kernel


class Topology(NamedTuple):
    """A port: `1-1.3` is port 3 of the hub in port 1 of bus 1.

    bus    1 and up.
    ports  1 to 6 of them, each 1 to 31.
    """

    bus: int
    ports: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.bus}-{'.'.join(map(str, self.ports))}"

    @property
    def port(self) -> int:
        """Its number at its hub."""
        return self.ports[-1]

    @property
    def hub(self) -> str:
        """The kernel's name of its hub: `1-1`, or `usb1` for the root hub of bus 1."""
        above = self.ports[:-1]
        return str(Topology(self.bus, above)) if above else f"usb{self.bus}"

    @property
    def hub_interface(self) -> str:
        """The kernel's name of the hub's one interface: `1-1:1.0`, or `1-0:1.0` for a root hub."""
        return f"{self.bus}-0:1.0" if len(self.ports) == 1 else f"{self.hub}:1.0"

    def holds(self, other: "Topology") -> bool:
        """Whether another port is this one, or is behind it: a module may have a hub of its own."""
        return self.bus == other.bus and other.ports[: len(self.ports)] == self.ports


def parse(text: str) -> Topology:
    """The port that a board file names. Raises ConfigurationError."""
    found = _TOPOLOGY.fullmatch(text)
    if found is None:
        raise ConfigurationError(
            f"{text!r} is not the place of a USB device",
            "bus-port.port as `ls /sys/bus/usb/devices` shows it: 1-1.3 is port 3 of the hub in port 1 of bus 1",
        )
    ports = tuple(map(int, found[2].split(".")))
    if len(ports) > MOST_LEVELS:
        raise ConfigurationError(f"{text!r}: {len(ports)} ports in a row", f"USB has {MOST_LEVELS} at most")
    if max(ports) > MOST_PORTS:
        raise ConfigurationError(f"{text!r}: port {max(ports)}", f"a hub has {MOST_PORTS} ports at most")
    return Topology(int(found[1]), ports)


def of_devpath(devpath: str) -> Topology | None:
    """The USB device that a path of sysfs is, or is a part of: an interface, a tty, a network device. None: no USB."""
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
    """The name of the place that holds a port: the nearest above it where one is behind another; None where none is.

    places  topology text by name, as slots have it; empty: not known.
    """
    held = {name: place for name, text in places.items() if text and (place := parse(text)).holds(topology)}
    return max(held, key=lambda name: len(held[name].ports), default=None)
