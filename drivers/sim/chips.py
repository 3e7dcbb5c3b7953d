"""Chips of the simulated board, in a worker, with a file of measurements and faults.

The worker of the simulated board can be killed like any other. Each chip therefore keeps its state in a file. The
station's process writes another file with the measurements and faults of all chips.
"""

import errno
import json
import os
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from board.bus_calls import serve
from board.description import Hardware, RailDescription
from board.i2c import explained
from board.machine import Machine
from drivers.sim.registers import Chip, Eeprom, Expander, Ina, Tmp102, hat_image

FOLDER = "chips"  # folder in Machine.dev
WORLD = "world.json"

REMEMBERED = 64  # transactions in SimulatedBus.seen

UUID = "d9f3a1c4-5e60-4b7a-9c2d-0123456789ab"


@dataclass
class Fault:
    """Fault of the transactions with an I2C address.

    number   errno: EREMOTEIO means not acknowledged, EBUSY taken by the kernel, EIO an aborted transfer.
    after    number of transactions that succeed before.
    times    number of transactions that fail; None: all later ones.
    seconds  time that each transaction blocks before it fails; a stuck bus gives ETIMEDOUT after 1 s.
    """

    number: int = errno.EREMOTEIO
    after: int = 0
    times: int | None = None
    seconds: float = 0.0

    def is_next(self) -> bool:
        """Count a transaction; return True if it fails."""
        if self.after:
            self.after -= 1
            return False
        if self.times is None:
            return True
        self.times -= 1
        return self.times >= 0


class SimulatedBus:
    """I2C bus with chips by address; an address without a chip does not answer.

    faults  by address.
    seen    last transactions: address, octets written, octets read.
    """

    def __init__(self, path: str, chips: Mapping[int, Chip], block: Callable[[float], None] = time.sleep) -> None:
        self.path = path
        self.faults: dict[int, Fault] = {}
        self.seen: deque[tuple[int, bytes, bytes]] = deque(maxlen=REMEMBERED)
        self._chips = chips
        self._block = block

    def transfer(self, address: int, write: bytes, read: int) -> bytes:
        """Write, then read. Raises InterfaceError if no chip answers at the address, or a simulated fault is due."""
        try:
            found = self._transfer(address, write, read)
        except OSError as error:
            raise explained(error, address, self.path) from error
        self.seen.append((address, write, found))
        return found

    def _transfer(self, address: int, write: bytes, read: int) -> bytes:
        fault = self.faults.get(address)
        if fault is not None and fault.is_next():
            if fault.seconds:
                self._block(fault.seconds)
            raise OSError(fault.number, os.strerror(fault.number))
        if address not in self._chips:
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        return self._chips[address].transfer(write, read)


def serve_simulated(channel: socket.socket) -> None:
    """Run the worker as serve() of board/bus_calls.py does, but with simulated buses."""
    serve(channel, FiledBus)


class FiledBus:
    """I2C bus for the worker, with the chips that a board file declares on it.

    It reads the file of measurements and faults before each transaction, and saves the state of the chip after it.
    """

    def __init__(self, name: str, hardware: Hardware, machine: Machine) -> None:
        self.path = hardware.buses[name].path
        self._name = name
        self._hardware = hardware
        self._folder = machine.dev / FOLDER
        self._folder.mkdir(parents=True, exist_ok=True)
        self._chips = chips_of(hardware, name)
        self._simulated = SimulatedBus(self.path, self._chips)
        self._world = ""
        for address, chip in self._chips.items():
            held = held_path(self._folder, name, address)
            if held.exists():
                chip.hold(held.read_bytes())

    def transfer(self, address: int, write: bytes, read: int) -> bytes:
        self._look()
        chip = self._chips.get(address)
        before = chip.held() if chip else b""
        found = self._simulated.transfer(address, write, read)
        if chip and chip.held() != before:
            _put(held_path(self._folder, self._name, address), chip.held())
        return found

    def _look(self) -> None:
        path = self._folder / WORLD
        text = path.read_text() if path.exists() else "{}"
        if text == self._world:
            return
        self._world = text
        world = json.loads(text)
        for name, rail in self._hardware.rails.items():
            chip = self._chips.get(rail.address) if rail.bus == self._name else None
            if isinstance(chip, Ina):
                chip.loads[rail.channel - 1] = tuple(world.get("rails", {}).get(name) or load_of(rail))
        for name, place in self._hardware.temperatures.items():
            chip = self._chips.get(place.address) if place.bus == self._name else None
            if isinstance(chip, Tmp102):
                chip.celsius = world.get("temperatures", {}).get(name, chip.celsius)
        for name, described in self._hardware.expanders.items():
            chip = self._chips.get(described.address) if described.bus == self._name else None
            if isinstance(chip, Expander):
                chip.outside = {int(pin): level for pin, level in world.get("pins", {}).get(name, {}).items()}
        faults = world.get("faults", {}).get(self._name, {})
        self._simulated.faults = {int(address): Fault(**fault) for address, fault in faults.items()}


class World:
    """Measurements and faults of the simulated chips, set in the station's process. Changes are effective at once."""

    def __init__(self, hardware: Hardware, machine: Machine) -> None:
        self._hardware = hardware
        self._folder = machine.dev / FOLDER
        self._folder.mkdir(parents=True, exist_ok=True)
        self._world: dict[str, dict[str, Any]] = {"rails": {}, "temperatures": {}, "pins": {}, "faults": {}}
        self._tell()

    def rail(self, name: str, volts: float, amps: float) -> None:
        self._world["rails"][name] = (volts, amps)
        self._tell()

    def temperature(self, name: str, celsius: float) -> None:
        self._world["temperatures"][name] = celsius
        self._tell()

    def force(self, expander: str, pin: int, level: bool | None) -> None:
        """Short a pin to a supply or to ground; None: remove the short."""
        pins = self._world["pins"].setdefault(expander, {})
        pins.pop(str(pin), None)
        if level is not None:
            pins[str(pin)] = level
        self._tell()

    def fail(self, bus: str, address: int, fault: Fault | None) -> None:
        """Make transactions with an address fail; None: end the fault."""
        faults = self._world["faults"].setdefault(bus, {})
        faults.pop(str(address), None)
        if fault is not None:
            faults[str(address)] = asdict(fault)
        self._tell()

    def is_active(self, line: str) -> bool:
        """Return True if a line on an expander is active, whatever process has set it."""
        described = self._hardware.lines[line]
        chip = self._hardware.expanders[described.expander]
        expander = Expander()
        held = held_path(self._folder, chip.bus, chip.address)
        if held.exists():
            expander.hold(held.read_bytes())
        return expander.levels[described.pin] != described.active_low

    def _tell(self) -> None:
        _put(self._folder / WORLD, json.dumps(self._world).encode())


def chips_of(hardware: Hardware, bus: str) -> dict[int, Chip]:
    """Return the chips that a board file declares on a bus, in their state after power-on."""
    chips: dict[int, Chip] = {}
    for expander in hardware.expanders.values():
        if expander.bus == bus:
            chips[expander.address] = Expander()
    for rail in hardware.rails.values():
        if rail.bus == bus and rail.address not in chips:
            chips[rail.address] = _ina(hardware, rail)
    for temperature in hardware.temperatures.values():
        if temperature.bus == bus:
            chips[temperature.address] = Tmp102()
    if hardware.identity is not None and hardware.identity.bus == bus:
        chips[hardware.identity.address] = Eeprom(hat_image("captain", "Quad Expander (simulated)", 1, 1, UUID))
    return chips


def load_of(rail: RailDescription) -> tuple[float, float]:
    """Return default volts and amperes of a rail, well within its limits."""
    low, high = rail.min_v or rail.max_v or 5.0, rail.max_v or rail.min_v or 5.0
    return (low + high) / 2, (rail.max_a or 1.0) / 4


def held_path(folder: Path, bus: str, address: int) -> Path:
    """Return the path of the file with the state of a chip."""
    return folder / f"{bus}-0x{address:02x}"


def _ina(hardware: Hardware, first: RailDescription) -> Ina:
    """Return the chip of a rail, with the channels of all rails that it measures."""
    channels = {
        rail.channel: rail for rail in hardware.rails.values() if (rail.bus, rail.address) == (first.bus, first.address)
    }
    count = 3 if first.kind == "ina3221" else 1
    described = [channels.get(channel) for channel in range(1, count + 1)]
    chip = Ina(first.kind, [rail.shunt_ohm if rail else 0.1 for rail in described])
    chip.loads = [load_of(rail) if rail else (0.0, 0.0) for rail in described]
    return chip


def _put(path: Path, octets: bytes) -> None:
    """Replace a file atomically: a concurrent reader gets either the old or the new content."""
    part = path.with_suffix(".part")
    part.write_bytes(octets)
    os.replace(part, path)
