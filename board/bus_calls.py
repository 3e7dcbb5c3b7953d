"""Blocking bus calls (I2C, EEPROM, hwmon, USB), executed in the board process.

board/board_worker.py sends them; README.md lists them. They are executed one after another, and each gets an answer.
"""

import json
import socket
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from board import hwmon, identity, usb
from board.chips import eeprom, expander, power, temperature
from board.description import ChipDescription, Hardware, LineDescription
from board.i2c import Bus, Transfer
from board.machine import Machine
from board.runtime.describe import Range, read, remedy
from board.runtime.errors import RequestError, StationError
from board.runtime.worker import messages

T = TypeVar("T")

# Opens the bus of this name in the board file. Raises InterfaceError.
OpenBus = Callable[[str, Hardware, Machine], Transfer]


def open_real_bus(name: str, hardware: Hardware, machine: Machine) -> Transfer:
    """Open an I2C bus of the kernel."""
    return Bus(hardware.buses[name].path, machine.sys)


def serve(channel: socket.socket, open_bus: OpenBus = open_real_bus) -> None:
    """Answer the calls of the parent process until it closes the channel. The first message is first_message().

    open_bus  opens a bus at its first use.
    """
    calls: BlockingBusCalls | None = None
    for message in messages(channel):
        if calls is None:
            calls = BlockingBusCalls(*read_first_message(message), open_bus)
        else:
            channel.send(calls.answer(message))


def first_message(hardware: Hardware, machine: Machine) -> bytes:
    """Return the message that configures the board process: the board file's tables, and the roots of kernel files."""
    tables = asdict(hardware)
    known = {field.name: _present(tables[field.name]) for field in fields(Hardware) if tables[field.name] is not None}
    roots = {name: str(root) for name, root in machine._asdict().items()}
    return json.dumps({"hardware": known, "machine": roots}).encode()


def read_first_message(message: bytes) -> tuple[Hardware, Machine]:
    """Return the hardware and the machine of a message of first_message()."""
    tables = json.loads(message)
    roots = tables["machine"]
    machine = Machine(Path(roots["sys"]), Path(roots["dev"]), Path(roots["proc"]), roots["uevents"])
    return read(Hardware, tables["hardware"], "the board file's tables"), machine


@dataclass(frozen=True)
class Nothing:
    """Arguments of calls that have none."""


@dataclass(frozen=True)
class Named:
    """Arguments of `rail` and `temperature`: the name in the board file."""

    name: str


@dataclass(frozen=True)
class Pin:
    """Argument of `expander_get`: the name of a line in the board file."""

    line: str


@dataclass(frozen=True)
class Level:
    """Arguments of `expander_set`: the name of a line in the board file, and its new state."""

    line: str
    active: bool


@dataclass(frozen=True)
class UsbPath:
    """Argument of `reset`: the topology path of a USB device."""

    usb: str


@dataclass(frozen=True)
class Switch:
    """Arguments of `authorize` and `hub_port`: the topology path of a USB device, and its new state."""

    usb: str
    on: bool


@dataclass(frozen=True)
class Percent:
    """Argument of `set_fan`: the drive in percent."""

    percent: Annotated[float, Range(0.0, 100.0)]


class BlockingBusCalls:
    """Executes the calls of one board: I2C, EEPROM, hwmon, USB power and reset."""

    def __init__(self, hardware: Hardware, machine: Machine, open_bus: OpenBus = open_real_bus) -> None:
        self._hardware = hardware
        self._machine = machine
        self._open_bus = open_bus
        self._buses: dict[str, Transfer] = {}

    def answer(self, message: bytes) -> bytes:
        """Execute a call; return its answer as JSON, which holds the value, or the error and its remedy."""
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
            raise RequestError(f"do: unknown call: {name!r}", remedy(name, CALLS))
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
        """Read volts, amperes and watts of a rail. Raises RequestError if the board file declares no such rail."""
        rail = _described(self._hardware.rails, which.name, "rails")
        if rail.hwmon:
            found = hwmon.rail(self._machine.sys, rail)
        else:
            found = power.read(self._bus(rail.bus), rail.address, rail.kind, rail.shunt_ohm, rail.channel)
        return {"v": round(found.volts, 4), "a": round(found.amps, 4), "w": round(found.watts, 4)}

    def temperature(self, which: Named) -> object:
        """Read a temperature in degrees Celsius. Raises RequestError if the board file declares no such sensor."""
        described = _described(self._hardware.temperatures, which.name, "temperatures")
        if described.kind == "tmp102":
            return temperature.read(self._bus(described.bus), described.address)
        return hwmon.temperature(self._machine.sys, described)

    def fan(self, _: Nothing) -> object:
        """Read speed and drive of the fan. Raises RequestError if the board file declares no fan."""
        return hwmon.fan(self._machine.sys, _declared(self._hardware.fan, "fan"))

    def set_fan(self, wanted: Percent) -> None:
        """Drive the fan, 0 to 100 percent. Raises RequestError if the board file declares no fan."""
        hwmon.set_fan(self._machine.sys, _declared(self._hardware.fan, "fan"), wanted.percent)

    def expander_set(self, wanted: Level) -> None:
        """Set a line of an expander. Raises RequestError if the line is not declared, or not on an expander."""
        line, chip = self._pin(wanted.line)
        is_high = wanted.active != line.active_low
        expander.set_level(self._bus(chip.bus), chip.address, line.pin, is_high, line.open_drain)

    def expander_get(self, which: Pin) -> object:
        """Return whether a line of an expander is active.

        Raises RequestError if the line is not declared, or not on an expander.
        """
        line, chip = self._pin(which.line)
        return expander.level(self._bus(chip.bus), chip.address, line.pin) != line.active_low

    def authorize(self, wanted: Switch) -> None:
        usb.authorize(self._machine, wanted.usb, wanted.on)

    def reset(self, which: UsbPath) -> None:
        usb.reset(self._machine, which.usb)

    def hub_port(self, wanted: Switch) -> None:
        usb.hub_port(self._machine, wanted.usb, wanted.on)

    def _bus(self, name: str) -> Transfer:
        """Return the bus of that name. It is opened at its first use; a failed opening is repeated at the next use."""
        if name not in self._buses:
            _described(self._hardware.buses, name, "buses")
            self._buses[name] = self._open_bus(name, self._hardware, self._machine)
        return self._buses[name]

    def _pin(self, name: str) -> tuple[LineDescription, ChipDescription]:
        line = _described(self._hardware.lines, name, "lines")
        if not line.expander:
            raise RequestError(f"lines.{name} is not on an expander", "the station sets it itself")
        return line, _described(self._hardware.expanders, line.expander, "expanders")


class Call(NamedTuple):
    """Arguments and method of one call: a row of the table in README.md."""

    arguments: type[Any]
    method: Callable[[BlockingBusCalls, Any], object]


CALLS: Mapping[str, Call] = {
    "identity": Call(Nothing, BlockingBusCalls.identity),
    "rail": Call(Named, BlockingBusCalls.rail),
    "temperature": Call(Named, BlockingBusCalls.temperature),
    "fan": Call(Nothing, BlockingBusCalls.fan),
    "set_fan": Call(Percent, BlockingBusCalls.set_fan),
    "expander_set": Call(Level, BlockingBusCalls.expander_set),
    "expander_get": Call(Pin, BlockingBusCalls.expander_get),
    "authorize": Call(Switch, BlockingBusCalls.authorize),
    "reset": Call(UsbPath, BlockingBusCalls.reset),
    "hub_port": Call(Switch, BlockingBusCalls.hub_port),
}


def _parsed(message: bytes) -> dict[str, object]:
    try:
        call = json.loads(message)
    except (ValueError, RecursionError):
        call = None
    if not isinstance(call, dict):
        raise RequestError(f"not a JSON object: {message[:40]!r} ({len(message)} octets)")
    return call


def _described(table: Mapping[str, T], name: str, where: str) -> T:
    if name not in table:
        raise RequestError(f"{where}.{name} is not declared in the board file", remedy(name, table))
    return table[name]


def _declared(described: T | None, where: str) -> T:
    if described is None:
        raise RequestError(f"[{where}] is not declared in the board file", "declare it there")
    return described


def _present(value: Any) -> Any:
    """Return a table without its None values; a board file omits them."""
    if isinstance(value, dict):
        return {key: _present(inner) for key, inner in value.items() if inner is not None}
    return value
