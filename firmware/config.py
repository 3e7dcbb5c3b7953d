"""captain.toml: what is wanted of the station; with a board file, which says what is there."""

import copy
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from board import describe
from board.address import mac_address
from board.errors import ConfigurationError
from drivers import DRIVERS
from firmware import bearers, board_file, consistency, receivers
from firmware.board_file import Board
from firmware.tables import QueueOptions, Tables

T = TypeVar("T")

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
    """All that a station is started with.

    written  names of the tables that captain.toml and the defaults have.
    """

    tables: Tables
    interfaces: tuple[InterfaceConfig, ...]
    board: Board
    mac: bytes
    written: frozenset[str] = field(default=frozenset(), compare=False)

    @cached_property
    def digest(self) -> str:
        """The first 16 hexadecimal digits of a SHA-256 of all of it: stations with the same are configured alike."""
        from hashlib import sha256  # with OpenSSL, which nobody else needs

        return sha256(_canonical(self).encode()).hexdigest()[:16]

    def digests(self) -> dict[str, int]:
        """CRC-32 of each part that needs a restart, by its name: two processes compare what they have read."""
        tables = {f"[{one.name}]": getattr(self.tables, one.name) for one in fields(Tables) if one.name != "policy"}
        parts = {**tables, "the board file": self.board}
        return {name: zlib.crc32(_canonical(part).encode()) for name, part in parts.items()}


class Source(NamedTuple):
    """The files and overrides of a configuration, as load() takes them."""

    path: str | None = None
    overrides: tuple[str, ...] = ()
    board: str | None = None
    defaults: str | None = None

    def load(self) -> Config:
        return load(*self)

    def files(self) -> list[str]:
        """Return the paths of the files that were given."""
        board = str(board_file.path_of(self.board)) if self.board else None
        return [one for one in (self.path, board, self.defaults) if one]


def _canonical(value: Any) -> str:
    """As text, the same in every process: sets and tables in order, what is made of neither by its name."""
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
    """Read captain.toml, lay it over the board's interfaces, apply `section.key=value` overrides and check it all.

    board     its name or file. By default the simulated one where no file says what is wanted, else none: nobody who
              wrote a configuration shall receive messages of stations that do not exist.
    defaults  another captain.toml, whose keys count where path has none of them: those of the box, which an owner
              who names his station need not know.

    Raises ConfigurationError that names every mistake with file and key path.
    """
    found, errors = examine(path, overrides, board, defaults)
    if len(errors) == 1:
        raise errors[0]
    if errors or found is None:
        raise ConfigurationError("\n".join(f"{one.message}; {one.hint}" if one.hint else one.message for one in errors))
    return found


def examine(
    path: str | None, overrides: Sequence[str] = (), board: str | None = None, defaults: str | None = None
) -> tuple[Config | None, list[ConfigurationError]]:
    """Return the readable part of a configuration, and every error. None if captain.toml or the board is unreadable.

    With errors, tables have defaults in place of invalid values, and only valid interfaces are left.
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
    present = copy.deepcopy(there.interfaces) if there else {}  # overrides are written into it
    merged: dict[str, Any] = {"interfaces": present} | wanted
    if isinstance(wanted.get("interfaces"), dict):
        merged["interfaces"] = _laid_over(present, wanted["interfaces"])
    for text in overrides:
        merged = _collect(errors, partial(_overridden, merged, text)) or merged
    where = path or ("--set" if overrides else at_board)
    tables = _tables(merged, where, errors)
    if there is None:
        return None, errors  # which interfaces and slots it has is not known
    written = tables.interfaces
    sources = {name: _source(name, wanted, overrides, at_board, where) for name in written}
    read = [_collect(errors, partial(_interface, name, written[name], there, sources[name])) for name in written]
    # What has a zero is told below; as a path it would end whoever looks at it.
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
    return Config(tables, tuple(sound), there, mac, frozenset(wanted)), errors


def _board(chosen: str, errors: list[ConfigurationError]) -> Board:
    found, wrong = board_file.examine(chosen)
    errors += map(ConfigurationError, wrong)
    return found


def _overridden(table: dict[str, Any], text: str) -> dict[str, Any]:
    """A table with an override; the one given stays as it is."""
    changed = copy.deepcopy(table)
    describe.override(changed, text)
    return changed


def _tables(merged: Mapping[str, Any], where: str, errors: list[ConfigurationError]) -> Tables:
    """Each table by itself: a mistake in one must not hide those of another, nor what several make together."""
    tables = Tables()
    for key, value in merged.items():
        part = _collect(errors, partial(describe.read, Tables, {key: value}, where))
        if part is not None:
            tables = replace(tables, **{key: getattr(part, key)})
        elif key in Tables.__dataclass_fields__:
            tables = replace(tables, **{key: _readable(getattr(tables, key), value)})
    return tables


def _readable(default: Any, value: Any) -> Any:
    """Return the readable part of an invalid table, each key by itself; of interfaces, those that are tables."""
    if isinstance(default, dict) and isinstance(value, dict):
        return {name: table for name, table in value.items() if isinstance(table, dict)}
    for key, said in value.items() if is_dataclass(default) and isinstance(value, dict) else ():
        with suppress(ConfigurationError):
            read = describe.read(type(default), {key: said}, "")
            default = replace(default, **{key: getattr(read, key)})
    return default


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
    keys = [text.partition("=")[0].strip() for text in overrides]
    is_above = is_above or any(key == "interfaces" or f"{key}.".startswith(f"interfaces.{name}.") for key in keys)
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
    """A locally administered address of this host and who runs on it: stations on one host need one each."""
    who = f"{tables.station.name}/{tables.endpoint.from_users}"
    try:
        machine = Path("/etc/machine-id").read_text().strip()
    except OSError:
        machine = ""
    machine = machine or os.uname().nodename  # containers have no machine-id, or share an empty one
    seed = f"{machine}/{who}".encode()
    return b"\x02" + zlib.crc32(seed).to_bytes(4, "big") + bytes((zlib.adler32(seed) & 0xFF,))
