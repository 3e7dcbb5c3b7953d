"""What blocks: I2C, EEPROM, hwmon, USB power and reset. This is the worker's side; board/remote.py asks it.

Its calls are in README.md. Calls are done one after another; each is answered, whatever becomes of it.
"""

import json
import socket
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from board import hwmon, identity, usb
from board.chips import eeprom, expander, power, temperature
from board.describe import Range, read, remedy
from board.description import ChipDescription, Hardware, LineDescription
from board.errors import RequestError, StationError
from board.i2c import Bus, Transfer
from board.machine import Machine
from board.worker import messages

T = TypeVar("T")

# By its name in the board file; raises InterfaceError.
OpenBus = Callable[[str, Hardware, Machine], Transfer]


def open_real_bus(name: str, hardware: Hardware, machine: Machine) -> Transfer:
    """The kernel's."""
    return Bus(hardware.buses[name].path, machine.sys)


def serve(channel: socket.socket, open_bus: OpenBus = open_real_bus) -> None:
    """Do what the parent asks until it closes; the first message is that of first_message().

    open_bus  gives a bus when it is used for the first time.
    """
    hands: Hands | None = None
    for message in messages(channel):
        if hands is None:
            hands = Hands(*read_first_message(message), open_bus)
        else:
            channel.send(hands.answer(message))


def first_message(hardware: Hardware, machine: Machine) -> bytes:
    """The board file's tables, of which the child knows no more than the hardware, and where the kernel's files are."""
    tables = asdict(hardware)
    known = {field.name: _present(tables[field.name]) for field in fields(Hardware) if tables[field.name] is not None}
    roots = {name: str(root) for name, root in machine._asdict().items()}
    return json.dumps({"hardware": known, "machine": roots}).encode()


def read_first_message(message: bytes) -> tuple[Hardware, Machine]:
    """The inverse of first_message()."""
    tables = json.loads(message)
    roots = tables["machine"]
    machine = Machine(Path(roots["sys"]), Path(roots["dev"]), Path(roots["proc"]), roots["uevents"])
    return read(Hardware, tables["hardware"], "the board file's tables"), machine


@dataclass(frozen=True)
class Nothing:
    """Arguments of a call without any."""


@dataclass(frozen=True)
class Named:
    """Of `rail` and `temperature`: its name in the board file."""

    name: str


@dataclass(frozen=True)
class Pin:
    """Of `expander_get`: a line of the board file."""

    line: str


@dataclass(frozen=True)
class Level:
    """Of `expander_set`."""

    line: str
    active: bool


@dataclass(frozen=True)
class Place:
    """Of `reset`: a topology path."""

    usb: str


@dataclass(frozen=True)
class Switch:
    """Of `authorize` and `hub_port`."""

    usb: str
    on: bool


@dataclass(frozen=True)
class Percent:
    """Of `set_fan`."""

    percent: Annotated[float, Range(0.0, 100.0)]


class Hands:
    """The calls of one board."""

    def __init__(self, hardware: Hardware, machine: Machine, open_bus: OpenBus = open_real_bus) -> None:
        self._hardware = hardware
        self._machine = machine
        self._open_bus = open_bus
        self._buses: dict[str, Transfer] = {}

    def answer(self, message: bytes) -> bytes:
        """Do a call; the answer as it goes over the channel. What cannot be done is answered with why."""
        number: object = None
        try:
            call = _parsed(message)
            number = call.pop("id", None)
            answer = {"value": self._do(call)}
        except StationError as error:
            answer = {"error": error.message, "hint": error.hint}
        return json.dumps({"id": number, **answer}).encode()

    def _do(self, call: dict[str, object]) -> object:
        name = call.pop("do", None)
        if not isinstance(name, str) or name not in CALLS:
            raise RequestError(f"do: {name!r} is no call of the board's worker", remedy(name, CALLS))
        arguments, method = CALLS[name]
        return method(self, read(arguments, call, name))

    def identity(self, _: Nothing) -> object:
        described = self._hardware.identity
        if described is None:
            return None
        if not described.bus:
            found = identity.of_device_tree(self._machine.proc)
            return found and found._asdict()
        bus = self._bus(described.bus)
        octets = eeprom.read(bus, described.address, 0, identity.ENOUGH)
        return identity.of_eeprom(octets, f"0x{described.address:02x} on {bus.path}")._asdict()

    def rail(self, which: Named) -> object:
        rail = _described(self._hardware.rails, which.name, "rails")
        if rail.hwmon:
            found = hwmon.rail(self._machine.sys, rail)
        else:
            found = power.read(self._bus(rail.bus), rail.address, rail.kind, rail.shunt_ohm, rail.channel)
        return {"v": round(found.volts, 4), "a": round(found.amps, 4), "w": round(found.watts, 4)}

    def temperature(self, which: Named) -> object:
        described = _described(self._hardware.temperatures, which.name, "temperatures")
        if described.kind == "tmp102":
            return temperature.read(self._bus(described.bus), described.address)
        return hwmon.temperature(self._machine.sys, described)

    def fan(self, _: Nothing) -> object:
        return hwmon.fan(self._machine.sys, _declared(self._hardware.fan, "fan"))

    def set_fan(self, wanted: Percent) -> None:
        hwmon.set_fan(self._machine.sys, _declared(self._hardware.fan, "fan"), wanted.percent)

    def expander_set(self, wanted: Level) -> None:
        line, chip = self._pin(wanted.line)
        is_high = wanted.active != line.active_low
        expander.set_level(self._bus(chip.bus), chip.address, line.pin, is_high, line.open_drain)

    def expander_get(self, which: Pin) -> object:
        line, chip = self._pin(which.line)
        return expander.level(self._bus(chip.bus), chip.address, line.pin) != line.active_low

    def authorize(self, wanted: Switch) -> None:
        usb.authorize(self._machine, wanted.usb, wanted.on)

    def reset(self, which: Place) -> None:
        usb.reset(self._machine, which.usb)

    def hub_port(self, wanted: Switch) -> None:
        usb.hub_port(self._machine, wanted.usb, wanted.on)

    def _bus(self, name: str) -> Transfer:
        """The bus of that name, opened when it is used for the first time; not again unless that failed."""
        if name not in self._buses:
            _described(self._hardware.buses, name, "buses")
            self._buses[name] = self._open_bus(name, self._hardware, self._machine)
        return self._buses[name]

    def _pin(self, name: str) -> tuple[LineDescription, ChipDescription]:
        line = _described(self._hardware.lines, name, "lines")
        if not line.expander:
            raise RequestError(f"lines.{name} is not on an expander", "it is set by the station itself")
        return line, _described(self._hardware.expanders, line.expander, "expanders")


class Call(NamedTuple):
    """A row of the table of README.md."""

    arguments: type[Any]
    method: Callable[[Hands, Any], object]


CALLS: Mapping[str, Call] = {
    "identity": Call(Nothing, Hands.identity),
    "rail": Call(Named, Hands.rail),
    "temperature": Call(Named, Hands.temperature),
    "fan": Call(Nothing, Hands.fan),
    "set_fan": Call(Percent, Hands.set_fan),
    "expander_set": Call(Level, Hands.expander_set),
    "expander_get": Call(Pin, Hands.expander_get),
    "authorize": Call(Switch, Hands.authorize),
    "reset": Call(Place, Hands.reset),
    "hub_port": Call(Switch, Hands.hub_port),
}


def _parsed(message: bytes) -> dict[str, object]:
    try:
        call = json.loads(message)
    except (ValueError, RecursionError):
        call = None
    if not isinstance(call, dict):
        raise RequestError(f"a call of {len(message)} octets is no JSON object: {message[:40]!r}")
    return call


def _described(table: Mapping[str, T], name: str, where: str) -> T:
    if name not in table:
        raise RequestError(f"{where}.{name} is not declared in the board file", remedy(name, table))
    return table[name]


def _declared(described: T | None, where: str) -> T:
    if described is None:
        raise RequestError(f"[{where}] is not declared in the board file", "what a board has is declared there")
    return described


def _present(value: Any) -> Any:
    """Without what is None, which a board file says by leaving it out."""
    if isinstance(value, dict):
        return {key: _present(inner) for key, inner in value.items() if inner is not None}
    return value
