"""The station's part of a set: captain.toml, board.toml and the files for brokers, as the station will read them."""

import ipaddress
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from board.errors import ConfigurationError, StationError
from drivers.ethernet import EthernetOptions
from drivers.mqtt_options import MqttOptions
from firmware import board_file, config, x509
from firmware.box.card import FOLDER, is_brokers
from firmware.box.note import Note, at, mistake, remark
from firmware.box.toml_lines import line_of, syntax_hint

OPEN_PORTS = range(5555, 5559)  # of the box's nftables.conf
PORTS = ("from_users", "to_users", "pull", "report")
STATE = "/var/lib/captain/"  # STATE_DIRECTORY and ReadWritePaths of the image's captain.service
RUN = "/run/captain/"  # its RuntimeDirectory
HERE = "/data/owner/current"  # its WorkingDirectory
FIRST_PORT = 1024  # that takes no right of its own; ip(7), ip_unprivileged_port_start
ALL = ("0.0.0.0", "::", "*")
IMAGES = "/etc/ssl/certs/"  # authorities of the image, which may be named as they are
OWN, BOARD = "captain.toml", "board.toml"
CABLE = "eth0"
CONSOLE = "/dev/ttyS1"  # console.device of the image
OTHER_PORTS = ("/dev/ttyS0", "/dev/ttyAMA0")  # of other systems' consoles, and of the Pi's Bluetooth


Saying = tuple[Callable[[str, str, str], Note], str, str]  # mistake or remark, what, remedy
Trouble = tuple[str, str, str]  # option, what is wrong with it, remedy


class StationFiles(NamedTuple):
    """What the station is to be started with.

    files     path = octets.
    places    what they are called on the card.
    scratch   an empty folder, in which they are read: paths in captain.toml begin there.
    board     the box's, unless there is a board.toml.
    defaults  captain.toml of the box, which the owner's is laid over, where this is the box.
    own       address that box.toml gives to eth0; empty: none.
    now       Unix time.
    """

    files: Mapping[str, bytes]
    places: Mapping[str, str]
    scratch: Path
    board: str
    defaults: str | None
    own: str
    now: float

    def at(self, name: str, path: str) -> str:
        """Where a key stands."""
        text = self.files[name].decode() if name in self.files else ""
        return at(self.places.get(name, name), line_of(text, path))


def look_at_station(given: StationFiles, notes: list[Note]) -> None:
    """What `captain run` would say of them, and what is no mistake of theirs but keeps users out of the box."""
    for name, octets in given.files.items():
        path = given.scratch / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(octets)
        path.chmod(0o600)
    with chdir(given.scratch):
        found = _loaded(given, notes)
        if found is not None:
            _look_at_endpoint(found, given, notes)
            _look_at_devices(found, given, notes)
            _look_at_recorder(found, given, notes)
            _look_at_brokers(found, given, notes)


def _loaded(given: StationFiles, notes: list[Note]) -> config.Config | None:
    board = f"./{BOARD}" if BOARD in given.files else given.board
    own = OWN if OWN in given.files else None
    try:
        board_file.load(board)
    except ConfigurationError as error:
        notes += [_of_line(line, error.hint, given) for line in error.message.split("\n")]
        board = given.board  # so that what captain.toml has wrong is told as well
    try:
        return config.load(own or given.defaults, (), board, given.defaults if own else None)
    except ConfigurationError as error:
        notes += [_of_line(line, error.hint, given) for line in error.message.split("\n")]
        return None


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
    said = tomllib.loads(given.files.get(OWN, b"").decode()).get("endpoint", {})
    ways = [(name, _port(getattr(endpoint, name))) for name in PORTS]
    ways += [("address", _address(endpoint.address, given.own)), ("control", _control(endpoint.control))]
    for name, trouble in ways:
        if name in said and trouble is not None:
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


def _control(path: str) -> Saying | None:
    whole = os.path.normpath(os.path.join(HERE, path))
    if not path or whole.startswith((RUN, STATE)):
        return None
    what = f"the station cannot write {os.path.dirname(whole)} on a box"
    return mistake, what, f'leave it out, or write "{RUN}NAME"'


def _look_at_devices(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """Interfaces at what the box itself is reached by."""
    for one in found.interfaces:
        where = f"interfaces.{one.name}"
        if isinstance(one.options, EthernetOptions) and one.options.device == CABLE:
            what = f"{where}.device: {CABLE} is the network of ssh and of users: frames of V2X go to whoever is there"
            notes.append(remark(given.at(OWN, f"{where}.device"), what, "a radio's is another one"))
        for name in ("device", "port"):
            path = os.path.normpath(getattr(one.options, name, ""))
            place = given.at(OWN, f"{where}.{name}")
            if path == CONSOLE:
                what = f"{where}.{name}: {path} is the serial console, and would be none any more"
                notes.append(mistake(place, what, "take another port, such as /dev/ttyUSB0"))
            elif path in OTHER_PORTS:
                what = f"{where}.{name}: {path} is at no pin of the header of this box"
                notes.append(remark(place, what, "/dev/ttyUSB0 is the first by USB"))


def _look_at_recorder(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """The service lets the station write in one place, whatever that is called elsewhere."""
    folder = os.path.normpath(found.tables.recorder.folder)
    if folder.startswith(("/", "..")) and not folder.startswith(STATE):
        what = f"recorder.folder: the station cannot write {folder} on a box"
        notes.append(remark(given.at(OWN, "recorder.folder"), what, 'write folder = "ring": it is in /data/captain'))


def _look_at_brokers(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """Certificates and keys as the client of a broker will load them; what no interface names is told."""
    there = [name for name in given.files if is_brokers(name)]
    used: set[str] = set()
    for one in found.interfaces:
        if isinstance(one.options, MqttOptions):
            used |= {os.path.normpath(path) for _, path, _ in one.options.files()}
            place = f"interfaces.{one.name}"
            missing = list(_missing(one.options, there))
            troubles = missing or list(_of_tls(one.options))
            for option, what, remedy in troubles:
                notes.append(mistake(given.at(OWN, f"{place}.{option}"), f"{place}.{what}", remedy))
            for option, what, remedy in () if troubles else _out_of_time(one.options, given):
                notes.append(remark(given.at(OWN, f"{place}.{option}"), f"{place}.{what}", remedy))
    notes += [
        remark(name, f"is named by no interface of {OWN}", f'for example: ca = "{name}"')
        for name in there
        if name not in used
    ]


def _missing(options: MqttOptions, there: list[str]) -> Iterator[Trouble]:
    for option, path, _ in options.files():
        if os.path.normpath(path).startswith(("/", "..")) and not path.startswith(IMAGES):
            yield option, f"{option}: {path} is not on the card", f"put it into {FOLDER}/, beside {OWN}"
        elif not os.path.exists(path):
            near = next((name for name in there if name.lower() == path.lower()), "")
            remedy = f"on the card it is written {near}" if near else f"put it into {FOLDER}/, beside {OWN}"
            yield option, f"{option}: there is no {path}", remedy


def _of_tls(options: MqttOptions) -> Iterator[Trouble]:
    from drivers import mqtt_credentials
    from drivers.mqtt_broker import broker

    try:
        if broker(options.url).has_tls:
            mqtt_credentials.context(options)
        if options.password_file:
            mqtt_credentials.password(options)
    except StationError as error:
        yield error.message.partition(" ")[0], error.message, error.hint


def _out_of_time(options: MqttOptions, given: StationFiles) -> Iterator[Trouble]:
    """What a broker, or this client, will not accept: no mistake, for it may be renewed, and clocks be wrong.

    A box has no clock before its first start, but never one that is ahead: there "not yet" means nothing.
    """
    now = datetime.fromtimestamp(given.now, UTC)
    for option in ("certificate", "ca"):
        path = getattr(options, option)
        try:
            found = x509.validities(Path(path).read_text(errors="replace")) if path else []
        except (StationError, OSError):
            continue  # OpenSSL has taken it
        if not found:
            continue
        begin, end = x509.period(found, is_any=option == "ca")
        if end <= now:
            yield (
                option,
                f"{option}: {path} has expired: {end:%Y-%m-%d %H:%M} UTC",
                "renew it: no connection comes about",
            )
        elif begin > now and given.defaults is None:
            yield (
                option,
                f"{option}: {path} is good from {begin:%Y-%m-%d %H:%M} UTC",
                "no connection comes about before",
            )
