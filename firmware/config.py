"""captain.toml: what is wanted of the station; with a board file, which says what is there."""

import copy
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from board import describe
from board.address import mac_address
from board.describe import Range
from board.errors import ConfigurationError
from drivers import DRIVERS
from drivers.sim.neighbours import NeighboursOptions
from firmware import consistency

BOARDS = Path(describe.__file__).parent / "boards"
Port = Annotated[int, Range(0, 65535)]
Octet = Annotated[int, Range(0, 255)]
StationId = Annotated[int, Range(0, 4294967295)]
Priority = Annotated[int, Range(0, 7)]
Seconds = Annotated[float, Range(0.0, 86400.0)]


@dataclass(frozen=True)
class Place:
    """A position in degrees, WGS84."""

    latitude: Annotated[float, Range(-90.0, 90.0)]
    longitude: Annotated[float, Range(-180.0, 180.0)]


@dataclass(frozen=True)
class StationOptions:
    """[station]: who this is.

    type       StationType of TS 102 894-2: 5 passenger car, 15 roadside unit, 0 unknown.
    is_mobile  itsGnIsMobile of EN 302 636-4-1: whether it may move while it runs.
    mac        own address; an empty one is made from host, name and port, locally administered.
    """

    name: str = "captain"
    type: Annotated[int, Range(0, 31)] = 0
    is_mobile: bool = True
    profile: Literal["standard", "legacy"] = "standard"
    mac: str = ""
    position: Place | None = None


@dataclass(frozen=True)
class EndpointOptions:
    """[endpoint]: where user programs connect. An ipc_ address is off when empty."""

    address: str = "127.0.0.1"
    from_users: Port = 5555
    to_users: Port = 5556
    pull: Port = 5557
    report: Port = 5558
    control: str = ""
    strict: bool = False
    local_info: bool = True
    ipc_in: str = ""
    ipc_out: str = ""


@dataclass(frozen=True)
class ReceptionOptions:
    """[reception]: what is passed on to users, and what is dropped with its reason."""

    unverified: Literal["drop", "deliver"] = "drop"
    gn_versions: tuple[Annotated[int, Range(0, 15)], ...] = (1,)
    unknown_btp_port: Literal["drop", "deliver"] = "drop"
    duplicate_window_s: Seconds = 2.0


@dataclass(frozen=True)
class QueueOptions:
    """The options that every [interfaces.<name>] has beside its driver's.

    queue       requests that may wait for it.
    rate_per_s  its pace; 0 is as fast as the driver takes them.
    technology  what status calls its medium, where the driver cannot know: its-g5 behind a udp or ethernet interface.
    """

    driver: str
    queue: Annotated[int, Range(1, 65536)] = 256
    rate_per_s: Annotated[float, Range(0.0, 100_000.0)] = 0.0
    technology: str = ""


@dataclass(frozen=True)
class InterfaceConfig:
    """One interface: its queue, and its driver's own options."""

    name: str
    queue: QueueOptions
    options: Any  # an instance of the driver's Options


@dataclass(frozen=True)
class TypeConfig:
    """[[types]]: a further or changed row of the table of message types."""

    number: Octet
    name: str
    btp_port: Port | None = None
    priority: Priority = 3
    lifetime_s: Seconds = 1.0
    traffic_class: Octet = 2


@dataclass(frozen=True)
class Span:
    """Limits of a number, both included; one left out is open."""

    min: int | None = None
    max: int | None = None


@dataclass(frozen=True)
class PayloadMatch:
    """Octets of the PDU from offset on, hexadecimal; only the bits of the mask are compared."""

    offset: Annotated[int, Range(0, 1499)]
    value: str
    mask: str = ""


@dataclass(frozen=True)
class NeighbourMatch:
    """At least `count` stations heard on an interface in the last within_s seconds, each at rssi_dbm or better."""

    interface: str
    within_s: Seconds = 5.0
    count: Annotated[int, Range(0, 4096)] = 1
    rssi_dbm: int | None = None


@dataclass(frozen=True)
class PlaceMatch:
    """Own position inside a circle."""

    latitude: Annotated[float, Range(-90.0, 90.0)]
    longitude: Annotated[float, Range(-180.0, 180.0)]
    radius_m: Annotated[float, Range(0.0, 1e7)]


@dataclass(frozen=True)
class Match:
    """When a row of the policy applies: all that is given must hold; an empty one always does."""

    type: tuple[str, ...] = ()
    station: tuple[StationId, ...] = ()
    size: Span = Span()
    btp_port: tuple[Port, ...] = ()
    traffic_class: tuple[Octet, ...] = ()
    area: Literal["", "none", "any", "inside", "outside"] = ""
    payload: tuple[PayloadMatch, ...] = ()
    link_up: tuple[str, ...] = ()
    link_down: tuple[str, ...] = ()
    bearer: bool | None = None
    neighbours: NeighbourMatch | None = None
    no_neighbours: NeighbourMatch | None = None
    position: PlaceMatch | None = None


@dataclass(frozen=True)
class PolicyRow:
    """[[policy]]: the first row whose match applies says how a message leaves.

    interfaces     that it leaves by; "*" is each that transmits; none drops it.
    fallback       those that it leaves by when none of them has its link up.
    priority, lifetime_s, traffic_class  in place of the type's own.
    rate_per_s     of messages that this row lets through; 0 is any.
    """

    name: str = ""
    match: Match = Match()
    interfaces: tuple[str, ...] = ("*",)
    fallback: tuple[str, ...] = ()
    priority: Priority | None = None
    lifetime_s: Seconds | None = None
    rate_per_s: Annotated[float, Range(0.0, 100_000.0)] = 0.0
    traffic_class: Octet | None = None


@dataclass(frozen=True)
class Tables:
    """The tables of captain.toml; interfaces are read once more, with their drivers' options."""

    station: StationOptions = StationOptions()
    endpoint: EndpointOptions = EndpointOptions()
    reception: ReceptionOptions = ReceptionOptions()
    interfaces: dict[str, dict[str, Any]] = field(default_factory=dict)
    types: tuple[TypeConfig, ...] = ()
    policy: tuple[PolicyRow, ...] = ()


@dataclass(frozen=True)
class Board:
    """A board file, as far as interfaces go: what is there before captain.toml says what is wanted of it."""

    name: str
    description: str = ""
    interfaces: dict[str, dict[str, Any]] = field(default_factory=dict)
    neighbours: NeighboursOptions | None = None


@dataclass(frozen=True)
class Config:
    """All that a station is started with."""

    tables: Tables
    interfaces: tuple[InterfaceConfig, ...]
    board: Board
    mac: bytes


def load(path: str | None, overrides: Sequence[str] = (), board: str | None = None) -> Config:
    """Read captain.toml, lay it over the board's interfaces, apply `section.key=value` overrides and check it all.

    board  its name or file. By default the simulated one where no file says what is wanted, else none: nobody who
           wrote a configuration shall receive messages of stations that do not exist.

    Raises ConfigurationError that names every mistake with file and key path.
    """
    there = load_board(("none" if path else "sim") if board is None else board)
    wanted = describe.load(Path(path)) if path else {}
    present = copy.deepcopy(there.interfaces)  # overrides are written into it
    merged: dict[str, Any] = {"interfaces": present} | wanted
    if isinstance(wanted.get("interfaces"), dict):
        merged["interfaces"] = _laid_over(present, wanted["interfaces"])
    for text in overrides:
        describe.override(merged, text)
    where = path or "captain.toml"
    mistakes: list[str] = []
    # Each table by itself: a mistake in one must not hide those of another, nor what several make together.
    tables = Tables()
    for key, value in merged.items():
        part = _collect(mistakes, lambda key=key, value=value: describe.read(Tables, {key: value}, where))
        if part is not None:
            tables = replace(tables, **{key: getattr(part, key)})
    interfaces = []
    for name, options in tables.interfaces.items():
        read = _collect(mistakes, lambda name=name, options=options: _interface(name, options, where))
        interfaces.append(read)
    mistakes += [f"{where}: {text}" for text in consistency.mistakes(tables)]
    mac = _collect(mistakes, lambda: _mac(tables, where))
    if mistakes:
        raise ConfigurationError("\n".join(mistakes))
    return Config(tables, tuple(interfaces), there, mac)


def load_board(board: str) -> Board:
    """A board by its name in board/boards (`sim`, `none`) or by the path of a file."""
    path = Path(board) if "/" in board or board.endswith(".toml") else BOARDS / f"{board}.toml"
    if path.parent == BOARDS and not path.exists():
        known = ", ".join(sorted(entry.stem for entry in BOARDS.glob("*.toml")))
        raise ConfigurationError(f"board {board!r} is not known", f"one of {known}, or the path of a board file")
    return describe.read(Board, describe.load(path), str(path))


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


def _interface(name: str, table: Mapping[str, Any], where: str) -> InterfaceConfig:
    common = {key: value for key, value in table.items() if key in QueueOptions.__dataclass_fields__}
    own = {key: value for key, value in table.items() if key not in common}
    place = f"{where}: interfaces.{name}"
    mistakes: list[str] = []
    queue = _collect(mistakes, lambda: describe.read(QueueOptions, common, place))
    word = table.get("driver")
    driver = DRIVERS.get(word) if isinstance(word, str) else None
    if driver is not None:
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
