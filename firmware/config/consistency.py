"""Consistency checks across tables of captain.toml: unknown names, resources used twice."""

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from typing import Any

from board.runtime.address import Address, address
from board.runtime.describe import remedy
from board.runtime.errors import ConfigurationError
from board.runtime.toml import show
from firmware.config.board_file import serial_option
from firmware.config.tables import MOST_NAME, EndpointOptions
from firmware.topics import ROWS
from firmware.untrusted import within

# Name of the interface that serves the interface processes of endpoint.ipc_in and ipc_out.
IPC = "ipc"
ALL = "0.0.0.0"  # address that means all addresses of this host
SOCKETS = ("from_users", "to_users", "pull", "report")
# Names of drop counters' places other than interfaces. No interface may have one of these names.
PLACES = frozenset({*SOCKETS, "from_brokers", "router"})
# Keys of the policy's rows that are only for sent messages. (`interfaces` is for received messages as well.)
LEAVING = ("fallback", "priority", "lifetime_s", "rate_per_s", "traffic_class")

Table = Mapping[str, Any]
Interfaces = Mapping[str, Table]


def mistakes(tables: Table, slots: Collection[str]) -> list[str]:
    """Return each mistake across tables, as `key.path: error; remedy`.

    tables  tables as written, so that a mistake in one does not hide others. Values of a wrong type are skipped,
            because describe.read reports them.
    slots   names of the board's slots.
    """
    found = [*types(tables), *_endpoint(within(tables, "endpoint"))]
    if not isinstance(tables.get("interfaces", {}), dict):
        return found  # the interfaces are unknown
    interfaces = {name: within(tables["interfaces"], name) for name in tables.get("interfaces", {})}
    has_ipc = any(within(tables, "endpoint").get(key) for key in ("ipc_in", "ipc_out"))
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


def _rows(table: Table, key: str) -> list[Table]:
    """Return an array of tables. Other items become empty tables, so that the index of each table stays the same."""
    found = table.get(key)
    return [row if isinstance(row, dict) else {} for row in found] if isinstance(found, list) else []


def _words(table: Table, key: str) -> list[str]:
    """Return the texts of an array. A text without brackets counts as an array of one; describe.read reports it."""
    found = table.get(key)
    return [word for word in (found if isinstance(found, list) else [found]) if isinstance(word, str)]


def _interfaces(interfaces: Interfaces, has_ipc: bool) -> Iterator[str]:
    for name in interfaces:
        if name in PLACES or name in {"", "*"}:
            yield f"interfaces: {name!r} cannot be an interface's name, because the name is reserved"
        elif not name.isprintable() or len(name) > MOST_NAME:
            yield f"interfaces: {show(name)} cannot be an interface's name: at most {MOST_NAME} printable characters"
    if IPC in interfaces and has_ipc:
        yield f"interfaces.{IPC}: this name is reserved for the interface processes of endpoint.ipc_in and ipc_out"


def _slots(interfaces: Interfaces, known: Collection[str]) -> Iterator[str]:
    """Report slots that the board does not have, and slots of two interfaces, which would both switch its power."""
    slots = _texts(interfaces, lambda options: "slot")
    for name, slot in slots.items():
        if slot not in known:
            yield f"interfaces.{name}.slot: the board has no slot {slot!r}; {remedy(slot, known)}"
    for name, first in _second({name: slot for name, slot in slots.items() if slot in known}):
        yield f"interfaces.{name}.slot: {slots[name]!r} is that of {first} already; a slot has one interface"


def _clients(interfaces: Interfaces) -> Iterator[str]:
    """Report MQTT client ids that two interfaces use at one broker, which would disconnect the first of them."""
    clients: dict[str, tuple[str, str]] = {}
    for name, options in interfaces.items():
        if options.get("driver") == "mqtt":
            from drivers.mqtt.broker import broker

            with suppress(ConfigurationError):  # invalid URLs are reported elsewhere
                where = broker(str(options.get("url"))).place
                clients[name] = where, str(options.get("client_id") or os.uname().nodename)
    for name, first in _second(clients):
        what = f"also that of {first} at the same broker"
        yield f"interfaces.{name}.client_id: {clients[name][1]!r} is {what}; give each its own"


def _serial_ports(interfaces: Interfaces) -> Iterator[str]:
    """Report serial ports of two interfaces: each interface would receive only part of the octets."""
    ports = _texts(interfaces, serial_option)
    for name, first in _second({name: os.path.realpath(port) for name, port in ports.items() if "\0" not in port}):
        key = serial_option(interfaces[name])
        what = f"is already used by {first}; a port can have one interface"
        yield f"interfaces.{name}.{key}: {show(ports[name])} {what}"


def _usb_places(interfaces: Interfaces) -> Iterator[str]:
    """Report USB modules that two interfaces use."""
    places = _texts(interfaces, lambda options: "" if options.get("kind") == "static" else "usb")
    for name, first in _second(places):
        yield f"interfaces.{name}.usb: {show(places[name])} is that of {first} already; a module has one interface"


def _listeners(interfaces: Interfaces) -> Iterator[str]:
    """Report UDP addresses at which two interfaces listen, because bind() of the second would fail.

    Two interfaces may share a multicast group, but a group and `listen` on all addresses of the host may not share a
    port.
    """
    taken: list[tuple[Address, bool, str]] = []
    for name, options in interfaces.items():
        for key in ("listen", "group") if options.get("driver") == "udp" else ():
            is_group = key == "group"
            try:
                at = address(str(options.get(key) or ""))
            except ConfigurationError:
                continue  # invalid addresses are reported elsewhere
            for other, is_other_group, whose in taken if at.port else ():  # port 0: any free one
                is_same = at.host == other.host and not is_group
                is_one_all = ALL in (at.host, other.host) and not (is_group and is_other_group)
                if at.port == other.port and (is_same or is_one_all):
                    what = f"that of {whose} already" + (f", {other}" if at != other else "")
                    yield f'interfaces.{name}.{key}: "{at}" is {what}; give each its own'
                    break
            taken.append((at, is_group, name))


def _texts(interfaces: Interfaces, key: Callable[[Mapping[str, Any]], str]) -> dict[str, str]:
    """Return the non-empty texts under a key, by interface. key: returns the key for the options of an interface."""
    found = {name: options.get(key(options)) for name, options in interfaces.items()}
    return {name: text for name, text in found.items() if text and isinstance(text, str)}


def _second(taken: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Yield each interface with the same value as an earlier one, together with the earlier one."""
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
        match = within(row, "match")
        yield from (
            f"{where}.match.{key}: empty; name one, or remove it" for key, value in match.items() if value == []
        )
        if match.get("implausible"):
            yield from (f"{where}.{mistake}" for mistake in _of_received(row))
        for name in _words(match, "type"):
            if types is not None and name not in types:
                yield f"{where}.match.type: unknown type {name!r}; one of {', '.join(sorted(types))}"


def _of_received(row: Table) -> Iterator[str]:
    """Report mistakes in a policy row for received messages: invalid `interfaces`, keys for sent messages."""
    if row.get("interfaces") not in ([], ["*"]):
        yield 'interfaces: invalid with match.implausible; write [] to drop these messages, or ["*"] to deliver them'
    for key in LEAVING:
        if key in row:
            yield f"{key}: not allowed with match.implausible, which matches received messages; remove {key}"


def _known_types(tables: Table) -> set[str] | None:
    """Return the names of message types; None if they are unknown, as [[types]] has a row without a valid name."""
    rows = _rows(tables, "types")
    names = {name for row in rows if isinstance(name := row.get("name"), str)}
    if "types" in tables and (not isinstance(tables["types"], list) or len(names) < len(rows)):
        return None
    numbers = [row.get("number") for row in rows]
    return {row.name for row in ROWS if row.number not in numbers} | names | {name.lower() for name in names}


def _unknown_interfaces(row: Table, known: set[str]) -> Iterator[tuple[str, str]]:
    """Yield each unknown interface in a policy row, with its key. "*" is valid only in `interfaces` and `fallback`."""
    match = within(row, "match")
    leaves = {key: _words(row, key) for key in ("interfaces", "fallback")}
    asked = {f"match.{key}": _words(match, key) for key in ("link_up", "link_down")}
    for key in ("neighbours", "no_neighbours"):
        asked[f"match.{key}.interface"] = _words(within(match, key), "interface")
    for names, more in ((leaves, {"*"}), (asked, set[str]())):
        yield from ((key, name) for key, given in names.items() for name in given if name not in known | more)


def types(tables: Table) -> Iterator[str]:
    """Yield each messageID that several rows of [[types]] have, as `types: error; remedy`."""
    numbers = [number for row in _rows(tables, "types") if type(number := row.get("number")) is int]
    for number in sorted({number for number in numbers if numbers.count(number) > 1}):
        yield f"types: number {number}: given {numbers.count(number)} times; give it once"


def _endpoint(endpoint: Table) -> Iterator[str]:
    written = [endpoint.get(key, getattr(EndpointOptions, key)) for key in SOCKETS]
    ports = [port for port in written if type(port) is int]
    for port in sorted({port for port in ports if port and ports.count(port) > 1}):
        yield f"endpoint: port {port} is given to two sockets; each needs its own"
    ipc_in = endpoint.get("ipc_in")
    if ipc_in and isinstance(ipc_in, str) and ipc_in == endpoint.get("ipc_out"):
        yield f"endpoint: ipc_in and ipc_out are both {ipc_in!r}; each needs its own"
