"""Board file: the hardware of a board and the default interfaces of a station on it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from board.description import (
    BusDescription,
    ChipDescription,
    Hardware,
    IdentityDescription,
    LineDescription,
    PulseDescription,
    RailDescription,
    SlotDescription,
    TemperatureDescription,
)
from board.runtime import describe
from board.runtime.describe import remedy
from board.runtime.errors import ConfigurationError
from drivers.sim.options import NeighboursOptions
from firmware.untrusted import within

SERIAL = {"uart": "device", "sim8202g": "port", "zed_f9p": "port"}  # option with the serial port, by driver

BOARDS = Path(describe.__file__).parents[1] / "boards"

# Tables with named subtables, such as [lines.x], and the class of a subtable. Other tables may refer to these names.
PARTS: dict[str, type] = {
    "lines": LineDescription,
    "buses": BusDescription,
    "expanders": ChipDescription,
    "rails": RailDescription,
    "temperatures": TemperatureDescription,
    "slots": SlotDescription,
}

# References between tables: a table, the key that holds a name, and the table in which this name must be declared.
NAMED = (
    ("lines", "expander", "expanders"),
    ("expanders", "bus", "buses"),
    ("rails", "bus", "buses"),
    ("temperatures", "bus", "buses"),
    ("slots", "power", "lines"),
    ("slots", "reset", "lines"),
)

UNKNOWN = "?"  # replaces an invalid `usb` of a slot

Tables = Mapping[str, object]
T = TypeVar("T")


@dataclass(frozen=True)
class Board(Hardware):
    """Contents of a board file: the hardware, and the default interfaces of a station on it.

    interfaces  interfaces as in captain.toml, which may override single keys.
    neighbours  simulated stations around this one.
    """

    interfaces: dict[str, dict[str, Any]] = field(default_factory=dict)
    neighbours: NeighboursOptions | None = None

    @property
    def has_hardware(self) -> bool:
        """True if the board declares any hardware: lines, rails, temperatures, fan, identity or slots."""
        return bool(self.lines or self.rails or self.temperatures or self.fan or self.identity or self.slots)


def path_of(board: str) -> Path:
    """Return the file of a board, given by its name or path."""
    return Path(board) if "/" in board or board.endswith(".toml") else BOARDS / f"{board}.toml"


def load(board: str) -> Board:
    """Read a board file, given by its name in board/boards (`sim`, `none`) or by its path.

    Raises ConfigurationError that names every mistake with file and key path.
    """
    found, wrong = examine(board)
    if wrong:
        raise ConfigurationError("\n".join(wrong))
    return found


def examine(board: str) -> tuple[Board, list[str]]:
    """Return the valid part of a board file, and all errors in it.

    Raises ConfigurationError if the board is unknown or its file cannot be read.
    """
    path = path_of(board)
    if path.parent == BOARDS and not path.exists():
        known = ", ".join(sorted(entry.stem for entry in BOARDS.glob("*.toml")))
        raise ConfigurationError(f"board {board!r} is not known", f"one of {known}, or the path of a board file")
    tables = describe.load(path)
    wrong: list[str] = []
    try:
        read = describe.read(Board, tables, str(path))
    except ConfigurationError as error:
        read, wrong = _sound(tables), error.message.split("\n")
    wrong += [f"{path}: {text}" for text in mistakes(read, tables)]
    for name, slot in within(tables, "slots").items():  # a slot with a mistake still counts as declared
        read.slots.setdefault(name, SlotDescription(usb=_value(slot, "usb") or UNKNOWN))
    return read, wrong


def _sound(tables: Tables) -> Board:
    """Return the valid subtables of a file with mistakes, so that mistakes across tables can be checked as well."""
    parts: dict[str, Any] = {
        part: {name: one for name, table in within(tables, part).items() if (one := _part(kind, table)) is not None}
        for part, kind in PARTS.items()
    }
    for key, kind in (("identity", IdentityDescription), ("pulse", PulseDescription)):
        parts[key] = _part(kind, tables.get(key))
    interfaces = {name: table for name, table in within(tables, "interfaces").items() if isinstance(table, dict)}
    return Board("", **parts, interfaces=interfaces)


def _part(kind: type[T], table: object) -> T | None:
    try:
        return describe.read(kind, table, "") if isinstance(table, dict) else None
    except ConfigurationError:
        return None


def mistakes(board: Hardware, tables: Tables) -> Iterator[str]:
    """Yield mistakes that concern several keys or tables, each as `key.path: error; remedy`.

    board   valid part of the board file.
    tables  all tables of the file as written.
    """
    for name, table in within(tables, "lines").items():
        yield from _line(f"lines.{name}", table)
    yield from _names(tables)
    for name, table in within(tables, "rails").items():
        yield from _limits(f"rails.{name}", table)
    for name, rail in board.rails.items():
        yield from _one_source(f"rails.{name}", rail, "bus and hwmon", rail.bus, rail.hwmon)
    for name, temperature in board.temperatures.items():
        yield from _temperature(f"temperatures.{name}", temperature)
    yield from _slots(board)
    yield from _pulse(board, tables)
    yield from _unprintable(tables)
    yield from _taken_twice(board, tables)


def _names(tables: Tables) -> Iterator[str]:
    """Check the references between tables as written, even those in a table with other mistakes."""
    yield from _unknown("identity.bus", _value(tables.get("identity"), "bus"), "buses", tables)
    for part, key, named in NAMED:
        for name, table in within(tables, part).items():
            yield from _unknown(f"{part}.{name}.{key}", _value(table, key), named, tables)


def _value(table: object, key: str) -> str:
    """Return the text of a key as written; empty if it is absent or not a text."""
    found = table.get(key) if isinstance(table, dict) else None
    return found if isinstance(found, str) else ""


def _line(where: str, table: object) -> Iterator[str]:
    """Check the source of a line as written. A table with an unknown key is skipped: describe.read reports it."""
    if not isinstance(table, dict) or any(key not in LineDescription.__dataclass_fields__ for key in table):
        return
    if sum(bool(table.get(key)) for key in ("chip", "line", "expander")) != 1:
        yield f"{where}: a line has one of chip, line and expander; give exactly one of them"


def _temperature(where: str, one: TemperatureDescription) -> Iterator[str]:
    if (one.kind == "tmp102") != bool(one.bus):
        yield f"{where}: only a tmp102 has a bus; {one.kind!r} is with {one.bus or 'no bus'!r}"
    elif one.kind != "tmp102" and not one.source:
        yield f"{where}.source: is missing; give the name of the {one.kind} device"


def _one_source(where: str, one: RailDescription, words: str, *given: str) -> Iterator[str]:
    if sum(map(bool, given)) != 1:
        yield f"{where}: a rail is read by one of {words}; give exactly one of them"


def _limits(where: str, table: object) -> Iterator[str]:
    """Check the limits of a rail as written. Values that are not numbers are skipped: describe.read reports them."""
    least, most = (table.get("min_v"), table.get("max_v")) if isinstance(table, dict) else (None, None)
    if isinstance(least, int | float) and isinstance(most, int | float) and least > most:
        yield f"{where}: min_v {least:g} is more than max_v {most:g}; no voltage is within both"


def _slots(board: Hardware) -> Iterator[str]:
    for name, slot in board.slots.items():
        where = f"slots.{name}"
        if slot.hub_port and not slot.usb:
            yield f"{where}.usb: is missing; a hub can switch a port only where its topology path is known"
        if slot.power and slot.power == slot.reset:
            yield f"{where}.reset: {slot.reset!r} is also the power line of the slot; name another line"


def _pulse(board: Hardware, tables: Tables) -> Iterator[str]:
    """Check [pulse] as written. A table with an unknown key is skipped: describe.read reports it."""
    table = tables.get("pulse")
    if not isinstance(table, dict) or any(key not in PulseDescription.__dataclass_fields__ for key in table):
        return
    if sum(bool(table.get(key)) for key in ("device", "chip", "line", "kind")) != 1:
        yield 'pulse: needs one of device, chip, line and kind = "simulated"; give exactly one of them'
    if table.get("chip") and "offset" not in table:
        yield "pulse.offset: is missing; give that of the line in its chip"
    if "offset" in table and not table.get("chip"):
        yield "pulse.offset: is that of a line in a chip; give its chip, or leave it out"
    if "gpio" in table and not table.get("device"):
        yield 'pulse.gpio: is that of a PPS device; give the device, such as "/dev/pps0", or leave it out'
    if table.get("kind") == "simulated" and tables.get("simulated") is not True:
        yield "pulse.kind: simulated pulses need a simulated board; give the device, or simulated = true for the board"
    place = _pin(board.pulse) if board.pulse else ""
    for name in (name for name, line in board.lines.items() if place and _pin(line) == place):
        yield f"pulse: {place!r} is already used by lines.{name}, an output; choose another line"


def _unprintable(tables: Tables) -> Iterator[str]:
    """Report device paths and names with unprintable characters: they reach the log, where a terminal executes them."""
    for part in (*PARTS, "pulse"):
        found = within(tables, part)
        for name, table in {"": found}.items() if part == "pulse" else found.items():
            for key in ("path", "device", "chip", "line", "usb"):
                if not _value(table, key).isprintable():
                    where = f"{part}.{name}.{key}" if name else f"{part}.{key}"
                    yield f"{where}: {_value(table, key)!r} has characters that cannot be printed; leave them out"


def _taken_twice(board: Hardware, tables: Tables) -> Iterator[str]:
    """Report resources that are used twice: pins of lines, addresses of chips, USB places and lines of slots."""
    yield from _twice("lines", "pin", {name: _pin(line) for name, line in board.lines.items()})
    yield from _addresses_twice(board)
    for key in ("usb", "power", "reset"):
        yield from _twice("slots", key, {name: _value(slot, key) for name, slot in within(tables, "slots").items()})


def _addresses_twice(board: Hardware) -> Iterator[str]:
    """Report addresses that two chips of a bus share. Rails of different channels of one INA3221 may share one."""
    first: dict[tuple[str, int], tuple[str, int]] = {}
    for table in ("expanders", "rails", "temperatures"):
        for name, chip in getattr(board, table).items():
            if not chip.bus or chip.kind == "thermal":
                continue
            channel = chip.channel if chip.kind == "ina3221" else 0
            other, taken = first.setdefault((chip.bus, chip.address), (f"{table}.{name}", channel))
            is_another_channel = channel and taken and channel != taken
            if other != f"{table}.{name}" and not is_another_channel:
                place = f"{chip.address:#04x} of {chip.bus}"
                yield f"{table}.{name}.address: {place} is already used by {other}; each needs its own"


def _pin(line: LineDescription | PulseDescription) -> str:
    if isinstance(line, LineDescription) and line.expander:
        return f"{line.expander} {line.pin}"
    return line.line or (f"{line.chip} {line.offset}" if line.chip else "")


def _twice(table: str, key: str, taken: dict[str, str]) -> Iterator[str]:
    first: dict[str, str] = {}
    for name, place in taken.items():
        if place in first:
            yield f"{table}.{name}.{key}: {place!r} is already used by {first[place]}; each needs its own"
        elif place:
            first[place] = name


def _unknown(where: str, name: str, table: str, tables: Tables) -> Iterator[str]:
    """Report a name that is not declared in a table; an empty name is not a reference."""
    known = within(tables, table)
    if name and not known:
        yield f"{where}: {name!r} is not declared; add a table [{table}.{name}]"
    elif name and name not in known:
        yield f"{where}: {name!r} is not declared; {remedy(name, known)}"


def serial_option(options: Mapping[str, Any]) -> str:
    """Return the key that holds the serial port of an interface; empty if its driver opens none."""
    return "" if options.get("kind") == "static" else SERIAL.get(str(options.get("driver")), "")
