"""Simulated machine: files and uevents of Linux, with a USB hub for modules.

A module boots when its supply comes, and disappears when the supply is cut. The supply needs an enabled port of the hub
and the kernel's authorization of the device. A board may also require a power line and the release of reset. Devices
that a module plugs in appear in the tree, and disappear with its supply.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from board.machine import Machine
from board.topology import Topology, parse
from drivers.sim.kobjects import Kobject, Kobjects
from drivers.sim.uevents import UeventSender
from drivers.sim.usb_tree import SimulatedDevice, SimulatedInterface, UsbTree

__all__ = ["SimulatedDevice", "SimulatedInterface", "SimulatedMachine"]

# Conditions of the supply on every board, in addition to the board's own.
PORT, AUTHORIZED = "hub port", "authorized"


@dataclass
class _Place:
    """Port of the hub, with its module.

    folder    folder of the port.
    missing   unmet conditions of the supply; the module is supplied when this set is empty.
    supplied  callback of the module for changes of its supply.
    device    device that the module has plugged in.
    parts     kernel objects of the device, in order of creation: the device itself first.
    """

    topology: Topology
    folder: Path
    missing: set[str] = field(default_factory=set)
    supplied: Callable[[bool], None] | None = None
    device: SimulatedDevice | None = None
    parts: list[Kobject] = field(default_factory=list)


class SimulatedMachine:
    """Folder with the files of a machine, and the Machine that describes it.

    hub    place of the hub for the modules; hubs above it are created, too.
    ports  number of its ports.
    """

    def __init__(self, folder: Path, hub: str = "1-1", ports: int = 4) -> None:
        self._uevents = UeventSender(folder / "uevents")
        self.machine = Machine(folder / "sys", folder / "dev", folder / "proc", self._uevents.path)
        for path in self.machine[:3]:
            path.mkdir(exist_ok=True)
        self._kernel = Kobjects(self.machine.sys, self.machine.dev, self._uevents)
        self._tree = UsbTree(self._kernel)
        made = self._tree.plant(parse(hub), ports)
        self._places = {str(topology): _Place(topology, path) for topology, path in made.items()}

    def sit(self, topology: str, supplied: Callable[[bool], None], missing: Sequence[str] = ()) -> None:
        """Put a module into a place.

        supplied  called with True or False when the supply comes or goes; at once if the supply is on.
        missing   conditions that supply() must meet first, in addition to the port and the authorization.
        """
        place = self._places[topology]
        place.supplied = supplied
        place.missing |= set(missing)
        if not place.missing:
            supplied(True)

    def leave(self, topology: str) -> None:
        """Pull the module out; the conditions of the place remain as they are."""
        place = self._places[topology]
        supplied, place.supplied = place.supplied, None
        was_supplied = not place.missing
        self._pull(place)
        if supplied is not None and was_supplied:
            supplied(False)

    def supply(self, topology: str, what: str, is_there: bool) -> None:
        """Meet or withdraw a condition of a place's supply: `power`, `release` of reset, or others of the board."""
        place = self._places[topology]
        if is_there is (what not in place.missing):
            return
        was_supplied = not place.missing
        if is_there:
            place.missing.remove(what)
        else:
            place.missing.add(what)
            self._lose(place, what)
        if was_supplied is bool(place.missing):
            self._tell(place)

    def plug(self, topology: str, device: SimulatedDevice) -> None:
        """Make a USB device appear and replace an earlier one; do nothing at a port without power supply."""
        place = self._places[topology]
        if not place.missing:
            self._pull(place)
            place.device = device
            place.parts.append(self._tree.enumerate(place.topology, device))
            place.parts += self._tree.configure(place.parts[0], device)

    def unplug(self, topology: str) -> None:
        """Make the device of a place disappear; idempotent.

        An unauthorized device stays, so that it can be authorized again.
        """
        place = self._places[topology]
        if place.supplied is None or AUTHORIZED not in place.missing:
            self._pull(place)

    def poll(self) -> None:
        """Process writes to the tree since the last call: `authorized` of devices, `disable` of ports."""
        for topology, place in self._places.items():
            self._obey(topology, PORT, place.folder / "disable", "0")
            if place.parts:
                self._obey(topology, AUTHORIZED, place.parts[0].folder / "authorized", "1")

    def close(self) -> None:
        """Close the uevent socket and all listeners; idempotent."""
        self._uevents.close()

    def _obey(self, topology: str, what: str, path: Path, yes: str) -> None:
        written = path.read_text().strip()
        if written:  # an empty file is being written at this moment
            self.supply(topology, what, written == yes)

    def _lose(self, place: _Place, what: str) -> None:
        if what == AUTHORIZED:
            self._remove(place, 1)
        else:
            self._pull(place)

    def _tell(self, place: _Place) -> None:
        if place.supplied is not None:
            if not place.missing:  # the module plugs its device in again after it has booted
                self._pull(place)
            place.supplied(not place.missing)
        elif place.parts and place.device is not None and not place.missing:
            place.parts += self._tree.configure(place.parts[0], place.device)

    def _pull(self, place: _Place) -> None:
        place.device = None
        self._remove(place, 0)
        # The device plugged in next is a new device, which the kernel authorizes by default.
        place.missing.discard(AUTHORIZED)

    def _remove(self, place: _Place, keep: int) -> None:
        """Remove the kernel objects of a place's device, except the first `keep`."""
        while len(place.parts) > keep:
            self._kernel.remove(place.parts.pop())
