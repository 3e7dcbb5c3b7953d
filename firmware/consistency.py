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
from firmware.tables import MOST_NAME, EndpointOptions, PayloadMatch, PolicyRow, Tables, TypeConfig
from firmware.topics import ROWS

# Interface processes appear as an interface of this name.
IPC = "ipc"
ALL = "0.0.0.0"  # each address of this host
SERIAL = {"uart": "device", "sim8202g": "port", "zed_f9p": "port"}  # driver = its option that is a serial port
# Where messages are dropped that no interface has: an interface so called would share their counters.
PLACES = frozenset({"from_users", "to_users", "pull", "report", "router"})


def mistakes(tables: Tables, slots: Collection[str]) -> list[str]:
    """Each as `key.path: what is wrong; what to do`.

    slots  names of those that the board has.
    """
    return [
        *_interfaces(tables),
        *_slots(tables, slots),
        *_clients(tables),
        *_serial_ports(tables),
        *_usb_places(tables),
        *_listeners(tables),
        *_policy(tables),
        *_types(tables.types),
        *_endpoint(tables.endpoint),
    ]


def _interfaces(tables: Tables) -> Iterator[str]:
    for name in tables.interfaces:
        if name in PLACES or name in {"", "*"}:
            yield f"interfaces: {name!r} cannot be an interface's name: it means something else"
        elif not name.isprintable() or len(name) > MOST_NAME:
            yield f"interfaces: {show(name)} cannot be an interface's name: at most {MOST_NAME} letters that print"
    if IPC in tables.interfaces and (tables.endpoint.ipc_in or tables.endpoint.ipc_out):
        yield f"interfaces.{IPC}: is the name of the interface processes of endpoint.ipc_in and ipc_out"


def _slots(tables: Tables, known: Collection[str]) -> Iterator[str]:
    """Each interface in a slot that there is, and alone: two could not agree on its power."""
    slots = _texts(tables, lambda options: "slot")
    for name, slot in slots.items():
        if slot not in known:
            yield f"interfaces.{name}.slot: the board has no slot {slot!r}; {remedy(slot, known)}"
    for name, first in _second({name: slot for name, slot in slots.items() if slot in known}):
        yield f"interfaces.{name}.slot: {slots[name]!r} is that of {first} already; a slot has one interface"


def _clients(tables: Tables) -> Iterator[str]:
    """Each interface at a broker is a client of its own: of two with one name the broker throws out the first."""
    clients: dict[str, tuple[Broker, str]] = {}
    for name, options in tables.interfaces.items():
        if options.get("driver") == "mqtt":
            with suppress(ConfigurationError):  # what is no URL is told where it is read
                where = broker(str(options.get("url")))
                clients[name] = where, str(options.get("client_id") or os.uname().nodename)
    for name, first in _second(clients):
        what = f"that of {first} at the same broker"
        yield f"interfaces.{name}.client_id: {clients[name][1]!r} is {what}; give each its own"


def _serial_ports(tables: Tables) -> Iterator[str]:
    """Each interface at a serial port of its own: of two each would get a part of what comes."""
    ports = _texts(tables, serial_option)
    for name, first in _second({name: os.path.realpath(port) for name, port in ports.items() if "\0" not in port}):
        key = serial_option(tables.interfaces[name])
        what = f"is that of {first} already; a port has one interface"
        yield f"interfaces.{name}.{key}: {show(ports[name])} {what}"


def _usb_places(tables: Tables) -> Iterator[str]:
    """Each interface at a module of its own."""
    places = _texts(tables, lambda options: "" if options.get("kind") == "static" else "usb")
    for name, first in _second(places):
        yield f"interfaces.{name}.usb: {show(places[name])} is that of {first} already; a module has one interface"


def _listeners(tables: Tables) -> Iterator[str]:
    """Each interface at an address of its own: the second could not listen. Groups are shared, but with none of all."""
    taken: list[tuple[Address, bool, str]] = []
    for name, options in tables.interfaces.items():
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


def _texts(tables: Tables, key: Callable[[Mapping[str, Any]], str]) -> dict[str, str]:
    """What interfaces have written under a key, where that is a text."""
    found = {name: options.get(key(options)) for name, options in tables.interfaces.items()}
    return {name: text for name, text in found.items() if text and isinstance(text, str)}


def _second(taken: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Interfaces that want what another has already, and who has it."""
    first: dict[object, str] = {}
    for name, what in taken.items():
        if (whose := first.setdefault(what, name)) != name:
            yield name, whose


def _policy(tables: Tables) -> Iterator[str]:
    own = {row.number: row.name for row in tables.types}
    names = {row.name for row in ROWS if row.number not in own} | set(own.values())
    interfaces = set(tables.interfaces)
    if tables.endpoint.ipc_in or tables.endpoint.ipc_out:
        interfaces.add(IPC)
    for index, row in enumerate(tables.policy):
        where = f"policy[{index}]"
        for key, name in _unknown_interfaces(row, interfaces):
            yield f"{where}.{key}: {name!r} is no interface; one of {', '.join(sorted(interfaces)) or 'none'}"
        for name in row.match.type:
            if name not in names:
                yield f"{where}.match.type: {name!r} is no type; one of {', '.join(sorted(names))}"
        least, most = row.match.size.min, row.match.size.max
        if least is not None and most is not None and least > most:
            yield f"{where}.match.size: min {least} is more than max {most}; no message is so long"
        for place, payload in enumerate(row.match.payload):
            yield from _payload(payload, f"{where}.match.payload[{place}]")


def _unknown_interfaces(row: PolicyRow, known: set[str]) -> Iterator[tuple[str, str]]:
    """Keys and names in a row that are no interface's; "*" is each where a message leaves, none where one is asked."""
    match = row.match
    leaves = {"interfaces": row.interfaces, "fallback": row.fallback}
    asked = {"match.link_up": match.link_up, "match.link_down": match.link_down}
    for key, near in (("neighbours", match.neighbours), ("no_neighbours", match.no_neighbours)):
        asked |= {f"match.{key}.interface": (near.interface,)} if near else {}
    for names, more in ((leaves, {"*"}), (asked, set[str]())):
        yield from ((key, name) for key, given in names.items() for name in given if name not in known | more)


def _payload(payload: PayloadMatch, where: str) -> Iterator[str]:
    try:
        value, mask = bytes.fromhex(payload.value), bytes.fromhex(payload.mask)
    except ValueError:
        yield f"{where}: value {payload.value!r} and mask {payload.mask!r} must be hexadecimal octets"
        return
    if not value:
        yield f"{where}: value is empty; give the octets to compare"
    elif mask and len(mask) != len(value):
        yield f"{where}: mask has {len(mask)} octets and value {len(value)}; they must be as many"


def _types(types: tuple[TypeConfig, ...]) -> Iterator[str]:
    numbers = [row.number for row in types]
    for number in sorted({number for number in numbers if numbers.count(number) > 1}):
        yield f"types: number {number} stands {numbers.count(number)} times; once is enough"
    for name in (row.name for row in types):
        if not name.replace("_", "a").isalnum() or name != name.lower() or not name.isascii():
            yield f"types: name {name!r} must be lower-case letters, digits and _"


def _endpoint(endpoint: EndpointOptions) -> Iterator[str]:
    ports = [endpoint.from_users, endpoint.to_users, endpoint.pull, endpoint.report]
    for port in sorted({port for port in ports if port and ports.count(port) > 1}):
        yield f"endpoint: port {port} is given to two sockets; each needs its own"
    if endpoint.ipc_in and endpoint.ipc_in == endpoint.ipc_out:
        yield f"endpoint: ipc_in and ipc_out are both {endpoint.ipc_in!r}; each needs its own"
