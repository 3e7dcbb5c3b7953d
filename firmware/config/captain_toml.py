"""Loader of captain.toml: combines it with board file, defaults and overrides."""

import copy
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from board.runtime import describe
from board.runtime.address import mac_address
from board.runtime.errors import ConfigurationError
from drivers import DRIVERS
from firmware.clock import receivers
from firmware.config import bearers, board_file, consistency, registered
from firmware.config.board_file import Board
from firmware.config.tables import QueueOptions, Tables

T = TypeVar("T")

# Options of a driver of a USB module that locate the module. Without any of them, the driver uses the USB place of the
# slot.
ELSEWHERE = {"usb", "port", "i2c"}
ZERO = "contains a NUL character, which no name may have; remove it"


@dataclass(frozen=True)
class InterfaceConfig:
    """Configuration of one interface: options of its queue, and options of its driver."""

    name: str
    queue: QueueOptions
    options: Any  # an instance of the driver's Options


@dataclass(frozen=True)
class Config:
    """Complete configuration of a station.

    mac      MAC address of the station.
    written  names of the tables that captain.toml and the file of defaults contain.
    types    paths of the files with registered message types.
    """

    tables: Tables
    interfaces: tuple[InterfaceConfig, ...]
    board: Board
    mac: bytes
    written: frozenset[str] = field(default=frozenset(), compare=False)
    types: tuple[str, ...] = field(default=(), compare=False)

    @cached_property
    def digest(self) -> str:
        """Identifier of the configuration: the first 16 hexadecimal digits of its SHA-256."""
        from hashlib import sha256  # imported on demand: it loads OpenSSL

        return sha256(_canonical(self).encode()).hexdigest()[:16]

    def digests(self) -> dict[str, int]:
        """Return the CRC-32 of each part that only a restart can change, by name. Processes compare them on reload."""
        tables = {f"[{one.name}]": getattr(self.tables, one.name) for one in fields(Tables) if one.name != "policy"}
        parts = {**tables, "the board file": self.board}
        return {name: zlib.crc32(_canonical(part).encode()) for name, part in parts.items()}


class ConfigSource(NamedTuple):
    """Files and overrides of a configuration: the arguments of load()."""

    path: str | None = None
    overrides: tuple[str, ...] = ()
    board: str | None = None
    defaults: str | None = None

    def load(self) -> Config:
        return load(*self)

    def files(self) -> list[str]:
        """Return the paths of the configuration files that the user named."""
        board = str(board_file.path_of(self.board)) if self.board else None
        return [one for one in (self.path, board, self.defaults) if one]


def _canonical(value: Any) -> str:
    """Return a value as text, in a form that is equal in every process.

    Sets and tables are sorted, and functions are represented by their names.
    """
    if is_dataclass(value) and not isinstance(value, type):
        value = {one.name: getattr(value, one.name) for one in fields(value) if one.compare}
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
    """Read captain.toml, merge it into the board's interfaces, apply overrides and check the result.

    path       captain.toml; None: defaults only.
    overrides  texts `section.key=value`.
    board      name or file of the board. Default: `sim` without captain.toml, else `none`, because a configured station
               must not receive simulated messages.
    defaults   second captain.toml, for keys that `path` does not contain. On a box it is the image's own file, and
               `path` is the owner's.

    Message types that are registered on this machine are part of it (registered.py).

    Raises ConfigurationError that names every mistake with file and key path.
    """
    found, errors = examine(path, overrides, board, defaults, registered.files())
    if len(errors) == 1:
        raise errors[0]
    if errors or found is None:
        raise ConfigurationError("\n".join(f"{one.message}; {one.hint}" if one.hint else one.message for one in errors))
    return found


def examine(
    path: str | None,
    overrides: Sequence[str] = (),
    board: str | None = None,
    defaults: str | None = None,
    types: tuple[str, ...] = (),
) -> tuple[Config | None, list[ConfigurationError]]:
    """Return the valid part of a configuration, and all errors. The first parameters are those of load().

    types  paths of the files with registered message types.

    The configuration is None if captain.toml or the board file cannot be read. If there are errors, defaults replace
    invalid values, and invalid interfaces are left out.
    """
    errors: list[ConfigurationError] = []
    chosen = ("none" if path else "sim") if board is None else board
    at_board = str(board_file.path_of(chosen))
    there = _collect(errors, lambda: _board(chosen, errors))
    wanted = _collect(errors, lambda: describe.load(Path(path))) if path else {}
    if wanted is None:
        return None, errors
    if defaults:
        wanted = _completed(wanted, _collect(errors, lambda: describe.load(defaults)) or {})
    present = copy.deepcopy(there.interfaces) if there else {}  # copied, because overrides change it
    merged: dict[str, Any] = {"interfaces": present} | wanted
    if isinstance(wanted.get("interfaces"), dict):
        merged["interfaces"] = _laid_over(present, wanted["interfaces"])
    for text in overrides:
        merged = _collect(errors, partial(_overridden, merged, text)) or merged
    merged = registered.completed(merged, types, errors)
    where = path or ("--set" if overrides else at_board)
    tables = _tables(merged, where, errors)
    if there is None:
        return None, errors  # without a readable board file, its interfaces and slots are unknown
    written = tables.interfaces
    sources = {name: _source(name, wanted, overrides, at_board, where) for name in written}
    read = [_collect(errors, partial(_interface, name, written[name], there, sources[name])) for name in written]
    # Interfaces with a NUL character in a text are left out, because it is invalid in a path. They are reported below.
    sound = [one for one in read if one is not None and not any(_zeros(written[one.name]))]
    mac = mac_address(tables.station.mac) if tables.station.mac else _made_mac(tables)
    more = consistency.mistakes(merged, there.slots)
    if isinstance(merged["interfaces"], dict):
        declared = {name: written.get(name, {}) for name in merged["interfaces"]}
        more += bearers.mistakes(declared, sound, mac)
        more += receivers.mistakes(tables.time, there.pulse, declared, sound, mac)
    errors += [ConfigurationError(f"{where}: {text}") for text in more]
    told = "\n".join(error.message for error in errors)
    errors += [ConfigurationError(f"{where}: {key}: {ZERO}") for key in _zeros(merged) if f": {key}: " not in told]
    return Config(tables, tuple(sound), there, mac, frozenset(wanted), types), errors


def _board(chosen: str, errors: list[ConfigurationError]) -> Board:
    found, wrong = board_file.examine(chosen)
    errors += map(ConfigurationError, wrong)
    return found


def _overridden(table: dict[str, Any], text: str) -> dict[str, Any]:
    """Return a copy of the tables with one override applied. Raises ConfigurationError if the override is invalid."""
    changed = copy.deepcopy(table)
    describe.override(changed, text)
    return changed


def _tables(merged: Mapping[str, Any], where: str, errors: list[ConfigurationError]) -> Tables:
    """Read each table separately, so that a mistake in one table does not hide those in others."""
    tables = Tables()
    for key, value in merged.items():
        part = _collect(errors, partial(describe.read, Tables, {key: value}, where))
        if part is not None:
            tables = replace(tables, **{key: getattr(part, key)})
        elif key in Tables.__dataclass_fields__:
            tables = replace(tables, **{key: _readable(getattr(tables, key), value)})
    return tables


def _readable(default: Any, value: Any) -> Any:
    """Return a table with the valid keys of an invalid one, and defaults for the others.

    For the table of interfaces, return those entries that are tables.
    """
    if isinstance(default, dict) and isinstance(value, dict):
        return {name: table for name, table in value.items() if isinstance(table, dict)}
    for key, said in value.items() if is_dataclass(default) and isinstance(value, dict) else ():
        with suppress(ConfigurationError):
            read = describe.read(type(default), {key: said}, "")
            default = replace(default, **{key: getattr(read, key)})
    return default


def _zeros(value: object, path: str = "") -> Iterator[str]:
    """Yield the key paths of all texts with a NUL character."""
    if isinstance(value, str) and "\0" in value:
        yield path
    elif isinstance(value, dict):
        for key, one in value.items():
            yield from _zeros(one, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for at, one in enumerate(value):
            yield from _zeros(one, f"{path}[{at}]")


def _source(name: str, wanted: Mapping[str, Any], overrides: Sequence[str], board: str, where: str) -> str:
    """Return the file to name for a mistake in an interface: captain.toml if it sets a key of it, else the board's."""
    above = wanted.get("interfaces")
    is_above = isinstance(above, dict) and name in above
    keys = [text.partition("=")[0].strip() for text in overrides]
    is_above = is_above or any(key == "interfaces" or f"{key}.".startswith(f"interfaces.{name}.") for key in keys)
    return where if is_above else board


def _completed(wanted: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables with missing tables and keys taken from the defaults."""
    merged = {**defaults, **wanted}
    for name in defaults.keys() & wanted.keys():
        if isinstance(defaults[name], dict) and isinstance(wanted[name], dict):
            merged[name] = {**defaults[name], **wanted[name]}
    return merged


def _laid_over(there: Mapping[str, Any], wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Merge interfaces of captain.toml into those of the board.

    An interface without the key `driver` overrides single keys of the board's; one with it replaces the board's.
    """
    merged = {**there, **wanted}
    for name in there.keys() & wanted.keys():
        if isinstance(wanted[name], dict) and "driver" not in wanted[name]:
            merged[name] = {**there[name], **wanted[name]}
    return merged


def _collect(errors: list[ConfigurationError], read: Callable[[], T]) -> T | None:
    try:
        return read()
    except ConfigurationError as error:
        errors.append(error)
        return None


def _interface(name: str, table: Mapping[str, Any], board: Board, where: str) -> InterfaceConfig:
    common = {key: value for key, value in table.items() if key in QueueOptions.__dataclass_fields__}
    own = {key: value for key, value in table.items() if key not in common}
    slot = board.slots.get(str(common.get("slot")))
    place = f"{where}: interfaces.{name}"
    errors: list[ConfigurationError] = []
    queue = _collect(errors, lambda: describe.read(QueueOptions, common, place))
    word = table.get("driver")
    driver = DRIVERS.get(word) if isinstance(word, str) else None
    if driver is not None:
        if slot is not None and "usb" in driver.Options.__dataclass_fields__ and not own.keys() & ELSEWHERE:
            own["usb"] = slot.usb
        options = _collect(errors, lambda: describe.read(driver.Options, own, place))
    elif isinstance(word, str):
        what = f"{place}.driver: unknown driver {word!r}; one of {', '.join(sorted(DRIVERS))}"
        errors.append(ConfigurationError(what))
    if errors or queue is None:
        raise ConfigurationError("\n".join(error.message for error in errors))
    return InterfaceConfig(name, queue, options)


def _made_mac(tables: Tables) -> bytes:
    """Return a locally administered MAC address, derived from machine, station name and port from_users."""
    who = f"{tables.station.name}/{tables.endpoint.from_users}"
    try:
        machine = Path("/etc/machine-id").read_text().strip()
    except OSError:
        machine = ""
    machine = machine or os.uname().nodename  # in containers, machine-id is absent or empty
    seed = f"{machine}/{who}".encode()
    return b"\x02" + zlib.crc32(seed).to_bytes(4, "big") + bytes((zlib.adler32(seed) & 0xFF,))
