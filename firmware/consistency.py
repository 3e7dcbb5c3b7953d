"""What only several tables of captain.toml together can tell: names that mean nothing, bits that do not fit."""

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from typing import Any

from board.address import Address, address
from board.describe import remedy
from board.errors import ConfigurationError
from board.toml import show
from drivers.mqtt_broker import Broker, broker
from firmware.tables import MOST_NAME, EndpointOptions
from firmware.topics import ROWS

# Interface processes appear as an interface of this name.
IPC = "ipc"
ALL = "0.0.0.0"  # each address of this host
SERIAL = {"uart": "device", "sim8202g": "port", "zed_f9p": "port"}  # driver = its option that is a serial port
SOCKETS = ("from_users", "to_users", "pull", "report")
# Where messages are dropped that no interface has: an interface so called would share their counters.
PLACES = frozenset({*SOCKETS, "router"})
# Keys of a row of the policy about how a message leaves, beside its interfaces.
LEAVING = ("fallback", "priority", "lifetime_s", "rate_per_s", "traffic_class")

Table = Mapping[str, Any]
Interfaces = Mapping[str, Table]


def mistakes(tables: Table, slots: Collection[str]) -> list[str]:
    """Each as `key.path: what is wrong; what to do`.

    tables  as they are written, so that a mistake in one hides none of another; what is of another kind than its key
            holds is told where it is read.
    slots   names of those that the board has.
    """
    found = [*_types(tables), *_endpoint(_table(tables, "endpoint"))]
    if not isinstance(tables.get("interfaces", {}), dict):
        return found  # which interfaces there are is not known
    interfaces = {name: _table(tables["interfaces"], name) for name in tables.get("interfaces", {})}
    has_ipc = any(_table(tables, "endpoint").get(key) for key in ("ipc_in", "ipc_out"))
    return [
        *_interfaces(interfaces, has_ipc),
        *_slots(interfaces, slots),
        *_clients(interfaces),
        *_serial_ports(interfaces),
        *_usb_places(interfaces),
        *_listeners(interfaces),
        *_policy(tables, {*interfaces, IPC} if has_ipc else set(interfaces)),
        *found,
    ]


def _table(tables: Table, key: str) -> Table:
    """A table in a table; empty where there is none, or something else."""
    found = tables.get(key)
    return found if isinstance(found, dict) else {}


def _rows(table: Table, key: str) -> list[Table]:
    """An array of tables; an item that is something else is an empty one, so that the others keep their numbers."""
    found = table.get(key)
    return [row if isinstance(row, dict) else {} for row in found] if isinstance(found, list) else []


def _words(table: Table, key: str) -> list[str]:
    """An array of texts; one that was written without its brackets is told, and still names something."""
    found = table.get(key)
    return [word for word in (found if isinstance(found, list) else [found]) if isinstance(word, str)]


def _interfaces(interfaces: Interfaces, has_ipc: bool) -> Iterator[str]:
    for name in interfaces:
        if name in PLACES or name in {"", "*"}:
            yield f"interfaces: {name!r} cannot be an interface's name: it means something else"
        elif not name.isprintable() or len(name) > MOST_NAME:
            yield f"interfaces: {show(name)} cannot be an interface's name: at most {MOST_NAME} letters that print"
    if IPC in interfaces and has_ipc:
        yield f"interfaces.{IPC}: is the name of the interface processes of endpoint.ipc_in and ipc_out"


def _slots(interfaces: Interfaces, known: Collection[str]) -> Iterator[str]:
    """Each interface in a slot that there is, and alone: two could not agree on its power."""
    slots = _texts(interfaces, lambda options: "slot")
    for name, slot in slots.items():
        if slot not in known:
            yield f"interfaces.{name}.slot: the board has no slot {slot!r}; {remedy(slot, known)}"
    for name, first in _second({name: slot for name, slot in slots.items() if slot in known}):
        yield f"interfaces.{name}.slot: {slots[name]!r} is that of {first} already; a slot has one interface"


def _clients(interfaces: Interfaces) -> Iterator[str]:
    """Each interface at a broker is a client of its own: of two with one name the broker throws out the first."""
    clients: dict[str, tuple[Broker, str]] = {}
    for name, options in interfaces.items():
        if options.get("driver") == "mqtt":
            with suppress(ConfigurationError):  # what is no URL is told where it is read
                where = broker(str(options.get("url")))
                clients[name] = where, str(options.get("client_id") or os.uname().nodename)
    for name, first in _second(clients):
        what = f"that of {first} at the same broker"
        yield f"interfaces.{name}.client_id: {clients[name][1]!r} is {what}; give each its own"


def _serial_ports(interfaces: Interfaces) -> Iterator[str]:
    """Each interface at a serial port of its own: of two each would get a part of what comes."""
    ports = _texts(interfaces, serial_option)
    for name, first in _second({name: os.path.realpath(port) for name, port in ports.items() if "\0" not in port}):
        key = serial_option(interfaces[name])
        what = f"is that of {first} already; a port has one interface"
        yield f"interfaces.{name}.{key}: {show(ports[name])} {what}"


def _usb_places(interfaces: Interfaces) -> Iterator[str]:
    """Each interface at a module of its own."""
    places = _texts(interfaces, lambda options: "" if options.get("kind") == "static" else "usb")
    for name, first in _second(places):
        yield f"interfaces.{name}.usb: {show(places[name])} is that of {first} already; a module has one interface"


def _listeners(interfaces: Interfaces) -> Iterator[str]:
    """Each interface at an address of its own: the second could not listen. Groups are shared, but with none of all."""
    taken: list[tuple[Address, bool, str]] = []
    for name, options in interfaces.items():
        for key in ("listen", "group") if options.get("driver") == "udp" else ():
            is_group = key == "group"
            try:
                at = address(str(options.get(key) or ""))
            except ConfigurationError:
                continue  # what is no address is told where it is read
            for other, is_other_group, whose in taken if at.port else ():  # port 0: any that is free
                is_same = at.host == other.host and not is_group
                is_one_all = ALL in (at.host, other.host) and not (is_group and is_other_group)
                if at.port == other.port and (is_same or is_one_all):
                    what = f"that of {whose} already" + (f", {other}" if at != other else "")
                    yield f'interfaces.{name}.{key}: "{at}" is {what}; give each its own'
                    break
            taken.append((at, is_group, name))


def serial_option(options: Mapping[str, Any]) -> str:
    """The key of the serial port that an interface opens; empty: it opens none."""
    return "" if options.get("kind") == "static" else SERIAL.get(str(options.get("driver")), "")


def _texts(interfaces: Interfaces, key: Callable[[Mapping[str, Any]], str]) -> dict[str, str]:
    """What interfaces have written under a key, where that is a text."""
    found = {name: options.get(key(options)) for name, options in interfaces.items()}
    return {name: text for name, text in found.items() if text and isinstance(text, str)}


def _second(taken: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Interfaces that want what another has already, and who has it."""
    first: dict[object, str] = {}
    for name, what in taken.items():
        if (whose := first.setdefault(what, name)) != name:
            yield name, whose


def _policy(tables: Table, interfaces: set[str]) -> Iterator[str]:
    types = _known_types(tables)
    for index, row in enumerate(_rows(tables, "policy")):
        where = f"policy[{index}]"
        for key, name in _unknown_interfaces(row, interfaces):
            yield f"{where}.{key}: unknown interface {name!r}; one of {', '.join(sorted(interfaces)) or 'none'}"
        match = _table(row, "match")
        yield from (
            f"{where}.match.{key}: empty; name one, or remove it" for key, value in match.items() if value == []
        )
        if match.get("implausible"):
            yield from (f"{where}.{mistake}" for mistake in _of_received(row))
        for name in _words(match, "type"):
            if types is not None and name not in types:
                yield f"{where}.match.type: unknown type {name!r}; one of {', '.join(sorted(types))}"


def _of_received(row: Table) -> Iterator[str]:
    """Yield mistakes of a row for received messages: invalid interfaces, keys for sent messages."""
    if row.get("interfaces") not in ([], ["*"]):
        yield 'interfaces: invalid with match.implausible; write [] to drop these messages, or ["*"] to deliver them'
    for key in LEAVING:
        if key in row:
            yield f"{key}: not allowed with match.implausible, which matches received messages; remove {key}"


def _known_types(tables: Table) -> set[str] | None:
    """Names that a row may have; None where a row of [[types]] has none that can be read: it may be any."""
    rows = _rows(tables, "types")
    names = {name for row in rows if isinstance(name := row.get("name"), str)}
    if "types" in tables and (not isinstance(tables["types"], list) or len(names) < len(rows)):
        return None
    numbers = [row.get("number") for row in rows]
    return {row.name for row in ROWS if row.number not in numbers} | names | {name.lower() for name in names}


def _unknown_interfaces(row: Table, known: set[str]) -> Iterator[tuple[str, str]]:
    """Keys and names in a row that are no interface's; "*" is each where a message leaves, none where one is asked."""
    match = _table(row, "match")
    leaves = {key: _words(row, key) for key in ("interfaces", "fallback")}
    asked = {f"match.{key}": _words(match, key) for key in ("link_up", "link_down")}
    for key in ("neighbours", "no_neighbours"):
        asked[f"match.{key}.interface"] = _words(_table(match, key), "interface")
    for names, more in ((leaves, {"*"}), (asked, set[str]())):
        yield from ((key, name) for key, given in names.items() for name in given if name not in known | more)


def _types(tables: Table) -> Iterator[str]:
    numbers = [number for row in _rows(tables, "types") if type(number := row.get("number")) is int]
    for number in sorted({number for number in numbers if numbers.count(number) > 1}):
        yield f"types: number {number} stands {numbers.count(number)} times; once is enough"


def _endpoint(endpoint: Table) -> Iterator[str]:
    written = [endpoint.get(key, getattr(EndpointOptions, key)) for key in SOCKETS]
    ports = [port for port in written if type(port) is int]
    for port in sorted({port for port in ports if port and ports.count(port) > 1}):
        yield f"endpoint: port {port} is given to two sockets; each needs its own"
    ipc_in = endpoint.get("ipc_in")
    if ipc_in and isinstance(ipc_in, str) and ipc_in == endpoint.get("ipc_out"):
        yield f"endpoint: ipc_in and ipc_out are both {ipc_in!r}; each needs its own"
