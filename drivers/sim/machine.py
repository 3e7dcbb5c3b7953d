"""A machine with a USB hub whose ports are places for simulated modules: the files of a Linux machine, and its uevents.

A module is whatever boots when it is supplied and is gone when it is not. The machine supplies it for as long as its
hub's port is on, the kernel is authorized to use it, and nothing else is missing that the board says: a power line, the
release of reset. What a module plugs in appears in the tree; when its supply goes, that disappears by itself.
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

# What takes the supply of a module away beside what the board names.
PORT, AUTHORIZED = "hub port", "authorized"


@dataclass
class _Place:
    """A port.

    folder    of the port.
    missing   what takes its supply away.
    supplied  tells the module that sits there.
    device    what that has plugged in.
    parts     of it, in the order they were made: the device itself first.
    """

    topology: Topology
    folder: Path
    missing: set[str] = field(default_factory=set)
    supplied: Callable[[bool], None] | None = None
    device: SimulatedDevice | None = None
    parts: list[Kobject] = field(default_factory=list)


class SimulatedMachine:
    """A folder, and the Machine to find it by.

    hub    where the hub is whose ports are the places; those above it are made, too.
    ports  how many it has.
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

        supplied  told when its supply comes and when it goes; at once where it is there already.
        missing   what it has to get by supply() before, beside the port and the kernel's authorization.
        """
        place = self._places[topology]
        place.supplied = supplied
        place.missing |= set(missing)
        if not place.missing:
            supplied(True)

    def leave(self, topology: str) -> None:
        """Pull the module out; what the place misses, it still does."""
        place = self._places[topology]
        supplied, place.supplied = place.supplied, None
        was_supplied = not place.missing
        self._pull(place)
        if supplied is not None and was_supplied:
            supplied(False)

    def supply(self, topology: str, what: str, is_there: bool) -> None:
        """Give a place what it misses, or take it away: `power`, `release` of reset, or whatever the board has."""
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
        """A device appears, in place of what was there; not at a place without supply."""
        place = self._places[topology]
        if not place.missing:
            self._pull(place)
            place.device = device
            place.parts.append(self._tree.enumerate(place.topology, device))
            place.parts += self._tree.configure(place.parts[0], device)

    def unplug(self, topology: str) -> None:
        """What is plugged in there disappears; idempotent. What is not authorized stays, for who may authorize it."""
        place = self._places[topology]
        if place.supplied is None or AUTHORIZED not in place.missing:
            self._pull(place)

    def poll(self) -> None:
        """Obey what was written into the tree since the last call: `authorized` of devices, `disable` of ports."""
        for topology, place in self._places.items():
            self._obey(topology, PORT, place.folder / "disable", "0")
            if place.parts:
                self._obey(topology, AUTHORIZED, place.parts[0].folder / "authorized", "1")

    def close(self) -> None:
        """Hang up on who listens to its uevents; idempotent."""
        self._uevents.close()

    def _obey(self, topology: str, what: str, path: Path, yes: str) -> None:
        written = path.read_text().strip()
        if written:  # else it is just being written
            self.supply(topology, what, written == yes)

    def _lose(self, place: _Place, what: str) -> None:
        if what == AUTHORIZED:
            self._remove(place, 1)
        else:
            self._pull(place)

    def _tell(self, place: _Place) -> None:
        if place.supplied is not None:
            if not place.missing:  # whatever the module had plugged in, it does so again when it has booted
                self._pull(place)
            place.supplied(not place.missing)
        elif place.parts and place.device is not None and not place.missing:
            place.parts += self._tree.configure(place.parts[0], place.device)

    def _pull(self, place: _Place) -> None:
        place.device = None
        self._remove(place, 0)
        # Whatever comes next is another device, and the kernel may use that.
        place.missing.discard(AUTHORIZED)

    def _remove(self, place: _Place, keep: int) -> None:
        """All parts of what is plugged in but the first so many."""
        while len(place.parts) > keep:
            self._kernel.remove(place.parts.pop())
