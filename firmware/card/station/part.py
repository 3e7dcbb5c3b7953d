"""Checks captain.toml, board.toml and files for brokers, as the station does."""

import ipaddress
import os
import tomllib
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path

from board.runtime.errors import ConfigurationError
from firmware.card.note import Note, at, mistake, remark
from firmware.card.station.devices import look_at_datagrams, look_at_devices, look_at_folders
from firmware.card.station.files import look_at_files
from firmware.card.station.given import BOARD, OWN, STATE, StationFiles
from firmware.card.toml_lines import syntax_hint
from firmware.config import board_file, captain_toml

OPEN_PORTS = range(5555, 5559)  # open in the box's nftables.conf
PORTS = ("from_users", "to_users", "pull", "report")
SOCKETS = ("ipc_in", "ipc_out")
RUN = "/run/captain/"  # RuntimeDirectory of the image's captain.service
HERE = "/data/owner/current"  # WorkingDirectory of captain.service
FIRST_PORT = 1024  # first port that needs no privilege; ip(7), ip_unprivileged_port_start
ALL = ("0.0.0.0", "::", "*")

Saying = tuple[Callable[[str, str, str], Note], str, str]  # mistake or remark, what, remedy


def look_at_station(given: StationFiles, notes: list[Note]) -> None:
    """Report what `captain run` would report, and valid settings that lock users out of the box."""
    for name, octets in given.files.items():
        path = given.scratch / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(octets)
        path.chmod(0o600)
    with chdir(given.scratch):
        found = _examined(given, notes)
        if found is not None:  # also if it has mistakes, so that all mistakes are reported at once
            _look_at_endpoint(found, given, notes)
            look_at_devices(found, given, notes)
            look_at_datagrams(found, given, notes)
            look_at_folders(found, given, notes)
            look_at_files(found, given, notes)


def _examined(given: StationFiles, notes: list[Note]) -> captain_toml.Config | None:
    board = f"./{BOARD}" if BOARD in given.files else given.board
    own = OWN if OWN in given.files else None
    try:
        board_file.load(board)
    except ConfigurationError as error:
        notes += [_of_line(line, error.hint, given) for line in error.message.split("\n")]
        board = given.board  # so that mistakes in captain.toml are reported as well
    found, errors = captain_toml.examine(own or given.defaults, (), board, given.defaults if own else None)
    notes += [_of_line(line, error.hint, given) for error in errors for line in error.message.split("\n")]
    return found


def _of_line(line: str, hint: str, given: StationFiles) -> Note:
    """Make a note of an error `file: key.path: what`, with the line number of the key or of the syntax error."""
    name, _, rest = line.partition(": ")
    name = Path(name).name
    path, _, what = rest.partition(": ")
    if path.startswith("line "):
        number = path.removeprefix("line ").partition(",")[0]
        return mistake(at(given.places.get(name, name), int(number)), f"is not TOML: {what}", hint or syntax_hint(what))
    inner = what.partition(": ")[0]  # example: `interfaces.g5: queue: 70000 is ...`
    return mistake(given.at(name, f"{path}.{inner}" if inner.isidentifier() else path), rest, hint)


def _look_at_endpoint(found: captain_toml.Config, given: StationFiles, notes: list[Note]) -> None:
    """Report endpoint options that prevent the start or lock users out; only those that the owner has written."""
    endpoint = found.tables.endpoint
    said = tomllib.loads(given.files.get(OWN, b"").decode()).get("endpoint")
    said = said if isinstance(said, dict) else {}
    ways = [(name, _port(getattr(endpoint, name))) for name in PORTS]
    ways += [
        ("address", _address(endpoint.address, given.own.partition("/")[0])),
        ("control", _control(endpoint.control)),
    ]
    ways += [(name, _socket(getattr(endpoint, name))) for name in SOCKETS]
    for name, trouble in ways:
        # An option that could not be read was reported already; its value then differs.
        if name in said and said[name] == getattr(endpoint, name) and trouble is not None:
            say, what, remedy = trouble
            notes.append(say(given.at(OWN, f"endpoint.{name}"), f"endpoint.{name}: {what}", remedy))


def _port(port: int) -> Saying | None:
    if port in OPEN_PORTS:
        return None
    if 0 < port < FIRST_PORT:
        what = f"port {port} is below 1024, which the station may not use"
        return mistake, what, "5555 to 5558 are open"
    return remark, f"the firewall blocks port {port}", "5555 to 5558 are open"


def _address(address: str, own: str) -> Saying | None:
    remedy = "leave it out for all addresses"
    if address in ALL:
        return None
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return mistake, f'invalid address: "{address}"', remedy
    if found.is_loopback:
        return remark, f'"{address}" is reachable from this box only', remedy
    if not own or found != ipaddress.ip_address(own):
        return mistake, f'the box has no address "{address}"', f"{remedy}, or give it to eth0 in box.toml"
    return remark, f'without a cable eth0 has no address "{address}", and the station does not start', remedy


def _socket(address: str) -> Saying | None:
    """Report ipc sockets: /tmp and new files belong to the station alone (PrivateTmp and UMask of captain.service)."""
    what = f"other programs of a box cannot open {address}"
    return (remark, what, "leave it out") if address else None


def _control(path: str) -> Saying | None:
    whole = os.path.normpath(os.path.join(HERE, path))
    if not path or whole.startswith((RUN, STATE)):
        return None
    what = f"the station cannot write {os.path.dirname(whole)} on a box"
    return mistake, what, f'leave it out, or write "{RUN}NAME"'
