"""captain.toml: what is wanted of the station; with a board file, which says what is there."""

import copy
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from board import describe
from board.address import mac_address
from board.errors import ConfigurationError
from drivers import DRIVERS
from drivers.message import NO_MAC
from firmware import bearers, board_file, consistency, receivers
from firmware.board_file import Board
from firmware.tables import QueueOptions, Tables

# A driver of a USB module looks where its slot is, unless one of its options tells it to look elsewhere.
ELSEWHERE = {"usb", "port", "i2c"}
ZERO = "has a zero, which no name of a file or a device has; leave it out"


@dataclass(frozen=True)
class InterfaceConfig:
    """One interface: its queue, and its driver's own options."""

    name: str
    queue: QueueOptions
    options: Any  # an instance of the driver's Options


@dataclass(frozen=True)
class Config:
    """All that a station is started with."""

    tables: Tables
    interfaces: tuple[InterfaceConfig, ...]
    board: Board
    mac: bytes

    @cached_property
    def digest(self) -> str:
        """The first 16 hexadecimal digits of a SHA-256 of all of it: stations with the same are configured alike."""
        from hashlib import sha256  # with OpenSSL, which nobody else needs

        return sha256(_canonical(self).encode()).hexdigest()[:16]


def _canonical(value: Any) -> str:
    """As text, the same in every process: sets and tables in order, what is made of neither by its name."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return "{" + ",".join(sorted(f"{_canonical(key)}:{_canonical(one)}" for key, one in value.items())) + "}"
    if isinstance(value, frozenset | set):
        return "{" + ",".join(sorted(map(_canonical, value))) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(map(_canonical, value)) + "]"
    return value.__qualname__ if callable(value) else repr(value)


def load(
    path: str | None, overrides: Sequence[str] = (), board: str | None = None, defaults: str | None = None
) -> Config:
    """Read captain.toml, lay it over the board's interfaces, apply `section.key=value` overrides and check it all.

    board     its name or file. By default the simulated one where no file says what is wanted, else none: nobody who
              wrote a configuration shall receive messages of stations that do not exist.
    defaults  another captain.toml, whose keys count where path has none of them: those of the box, which an owner
              who names his station need not know.

    Raises ConfigurationError that names every mistake with file and key path.
    """
    chosen = ("none" if path else "sim") if board is None else board
    there = board_file.load(chosen)
    wanted = describe.load(Path(path)) if path else {}
    if defaults:
        wanted = _completed(wanted, describe.load(defaults))
    present = copy.deepcopy(there.interfaces)  # overrides are written into it
    merged: dict[str, Any] = {"interfaces": present} | wanted
    if isinstance(wanted.get("interfaces"), dict):
        merged["interfaces"] = _laid_over(present, wanted["interfaces"])
    for text in overrides:
        describe.override(merged, text)
    where = path or ("--set" if overrides else str(board_file.path_of(chosen)))
    mistakes: list[str] = []
    # Each table by itself: a mistake in one must not hide those of another, nor what several make together.
    tables = Tables()
    for key, value in merged.items():
        part = _collect(mistakes, lambda key=key, value=value: describe.read(Tables, {key: value}, where))
        if part is not None:
            tables = replace(tables, **{key: getattr(part, key)})
    interfaces = []
    for name, options in tables.interfaces.items():
        source = _source(name, wanted, overrides, str(board_file.path_of(chosen)), where)
        read = _collect(mistakes, lambda name=name, options=options, at=source: _interface(name, options, there, at))
        interfaces.append(read)
    mistakes += [f"{where}: {text}" for text in consistency.mistakes(tables, there.slots)]
    mac = _collect(mistakes, lambda: _mac(tables, where))
    sound = [one for one in interfaces if one is not None]
    mistakes += [f"{where}: {text}" for text in bearers.mistakes(tables.interfaces, sound, mac or NO_MAC)]
    clocked = receivers.mistakes(tables.time, there.pulse, tables.interfaces, sound, mac or NO_MAC)
    mistakes += [f"{where}: {text}" for text in clocked]
    mistakes += [f"{where}: {path}: {ZERO}" for path in _zeros(merged) if f": {path}: " not in "\n".join(mistakes)]
    if mistakes:
        raise ConfigurationError("\n".join(mistakes))
    return Config(tables, tuple(interfaces), there, mac)


def _zeros(value: object, path: str = "") -> Iterator[str]:
    """Places of texts with a zero, which ends a name of a file or a device wherever the system is given one."""
    if isinstance(value, str) and "\0" in value:
        yield path
    elif isinstance(value, dict):
        for key, one in value.items():
            yield from _zeros(one, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for at, one in enumerate(value):
            yield from _zeros(one, f"{path}[{at}]")


def _source(name: str, wanted: Mapping[str, Any], overrides: Sequence[str], board: str, where: str) -> str:
    """The file that a mistake in an interface is to be looked for in."""
    above = wanted.get("interfaces")
    is_above = isinstance(above, dict) and name in above
    is_above = is_above or any(f"{text.partition('=')[0]}.".startswith(f"interfaces.{name}.") for text in overrides)
    return where if is_above else board


def _completed(wanted: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with the keys that only the defaults have."""
    merged = {**defaults, **wanted}
    for name in defaults.keys() & wanted.keys():
        if isinstance(defaults[name], dict) and isinstance(wanted[name], dict):
            merged[name] = {**defaults[name], **wanted[name]}
    return merged


def _laid_over(there: Mapping[str, Any], wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Interfaces of the board with what the file says of them; one with a driver of its own is another interface."""
    merged = {**there, **wanted}
    for name in there.keys() & wanted.keys():
        if isinstance(wanted[name], dict) and "driver" not in wanted[name]:
            merged[name] = {**there[name], **wanted[name]}
    return merged


def _collect(mistakes: list[str], read: Any) -> Any:
    try:
        return read()
    except ConfigurationError as error:
        mistakes.append(str(error))
        return None


def _interface(name: str, table: Mapping[str, Any], board: Board, where: str) -> InterfaceConfig:
    common = {key: value for key, value in table.items() if key in QueueOptions.__dataclass_fields__}
    own = {key: value for key, value in table.items() if key not in common}
    slot = board.slots.get(str(common.get("slot")))
    place = f"{where}: interfaces.{name}"
    mistakes: list[str] = []
    queue = _collect(mistakes, lambda: describe.read(QueueOptions, common, place))
    word = table.get("driver")
    driver = DRIVERS.get(word) if isinstance(word, str) else None
    if driver is not None:
        if slot is not None and "usb" in driver.Options.__dataclass_fields__ and not own.keys() & ELSEWHERE:
            own["usb"] = slot.usb
        options = _collect(mistakes, lambda: describe.read(driver.Options, own, place))
    elif isinstance(word, str):
        mistakes.append(f"{place}.driver: {word!r} is no driver; one of {', '.join(sorted(DRIVERS))}")
    if mistakes:
        raise ConfigurationError("\n".join(mistakes))
    return InterfaceConfig(name, queue, options)


def _mac(tables: Tables, where: str) -> bytes:
    station = tables.station
    if not station.mac:
        return _made_mac(f"{station.name}/{tables.endpoint.from_users}")
    try:
        return mac_address(station.mac)
    except ConfigurationError as error:
        raise ConfigurationError(f"{where}: station.mac: {error.message}; {error.hint}") from error


def _made_mac(who: str) -> bytes:
    """A locally administered address of this host and who runs on it: stations on one host need one each."""
    try:
        machine = Path("/etc/machine-id").read_text().strip()
    except OSError:
        machine = ""
    machine = machine or os.uname().nodename  # containers have no machine-id, or share an empty one
    seed = f"{machine}/{who}".encode()
    return b"\x02" + zlib.crc32(seed).to_bytes(4, "big") + bytes((zlib.adler32(seed) & 0xFF,))
