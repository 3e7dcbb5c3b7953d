"""The station's part of a set: captain.toml, board.toml and the files for brokers, as the station will read them."""

import ipaddress
import os
import tomllib
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path

from board.errors import ConfigurationError
from firmware import board_file, config
from firmware.box.note import Note, at, mistake, remark
from firmware.box.station_devices import look_at_datagrams, look_at_devices, look_at_folders
from firmware.box.station_files import look_at_files
from firmware.box.station_given import BOARD, OWN, STATE, StationFiles
from firmware.box.toml_lines import syntax_hint

OPEN_PORTS = range(5555, 5559)  # of the box's nftables.conf
PORTS = ("from_users", "to_users", "pull", "report")
SOCKETS = ("ipc_in", "ipc_out")
RUN = "/run/captain/"  # RuntimeDirectory of the image's captain.service
HERE = "/data/owner/current"  # its WorkingDirectory
FIRST_PORT = 1024  # that takes no right of its own; ip(7), ip_unprivileged_port_start
ALL = ("0.0.0.0", "::", "*")

Saying = tuple[Callable[[str, str, str], Note], str, str]  # mistake or remark, what, remedy


def look_at_station(given: StationFiles, notes: list[Note]) -> None:
    """What `captain run` would say of them, and what is no mistake of theirs but keeps users out of the box."""
    for name, octets in given.files.items():
        path = given.scratch / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(octets)
        path.chmod(0o600)
    with chdir(given.scratch):
        found = _examined(given, notes)
        if found is not None:  # beside its mistakes, so that all are told at once
            _look_at_endpoint(found, given, notes)
            look_at_devices(found, given, notes)
            look_at_datagrams(found, given, notes)
            look_at_folders(found, given, notes)
            look_at_files(found, given, notes)


def _examined(given: StationFiles, notes: list[Note]) -> config.Config | None:
    board = f"./{BOARD}" if BOARD in given.files else given.board
    own = OWN if OWN in given.files else None
    try:
        board_file.load(board)
    except ConfigurationError as error:
        notes += [_of_line(line, error.hint, given) for line in error.message.split("\n")]
        board = given.board  # so that what captain.toml has wrong is told as well
    found, errors = config.examine(own or given.defaults, (), board, given.defaults if own else None)
    notes += [_of_line(line, error.hint, given) for error in errors for line in error.message.split("\n")]
    return found


def _of_line(line: str, hint: str, given: StationFiles) -> Note:
    """`file: key.path: what` with the line of the key; of a mistake in the text the parser tells the line itself."""
    name, _, rest = line.partition(": ")
    name = Path(name).name
    path, _, what = rest.partition(": ")
    if path.startswith("line "):
        number = path.removeprefix("line ").partition(",")[0]
        return mistake(at(given.places.get(name, name), int(number)), f"is not TOML: {what}", hint or syntax_hint(what))
    inner = what.partition(": ")[0]  # `interfaces.g5: queue: 70000 is ...`
    return mistake(given.at(name, f"{path}.{inner}" if inner.isidentifier() else path), rest, hint)


def _look_at_endpoint(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """Where the station would not start, or nobody would reach it. What the owner has not written is the image's."""
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
        # One that cannot be read is told already.
        if name in said and said[name] == getattr(endpoint, name) and trouble is not None:
            say, what, remedy = trouble
            notes.append(say(given.at(OWN, f"endpoint.{name}"), f"endpoint.{name}: {what}", remedy))


def _port(port: int) -> Saying | None:
    if port in OPEN_PORTS:
        return None
    if 0 < port < FIRST_PORT:
        what = f"port {port} is one of the system's, which the station may not take"
        return mistake, what, "5555 to 5558 are open"
    return remark, f"the box lets nobody in at port {port}", "5555 to 5558 are open"


def _address(address: str, own: str) -> Saying | None:
    remedy = "leave it out for all addresses"
    if address in ALL:
        return None
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return mistake, f'"{address}" is no address', remedy
    if found.is_loopback:
        return remark, f'"{address}" is reached from this box only', remedy
    if not own or found != ipaddress.ip_address(own):
        return mistake, f'the box is given no "{address}"', f"{remedy}, or give it to eth0 in box.toml"
    return remark, f'no station starts while eth0 does not have "{address}": without a cable', remedy


def _socket(address: str) -> Saying | None:
    """Its /tmp is the station's own, and so is what it makes anywhere (PrivateTmp and UMask of captain.service)."""
    what = f"no other program of a box may open {address}"
    return (remark, what, "leave it out") if address else None


def _control(path: str) -> Saying | None:
    whole = os.path.normpath(os.path.join(HERE, path))
    if not path or whole.startswith((RUN, STATE)):
        return None
    what = f"the station cannot write {os.path.dirname(whole)} on a box"
    return mistake, what, f'leave it out, or write "{RUN}NAME"'
