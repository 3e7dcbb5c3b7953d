"""What a station needs of its machine, looked at one thing at a time: each check gives findings with a remedy."""

import platform
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import zmq

from board.address import address
from board.errors import StationError
from drivers import DRIVERS
from drivers.contract import Shared
from firmware.board_file import Board
from firmware.codec.library import Library, NoLibraryError
from firmware.config import Config, InterfaceConfig
from firmware.lab import ports
from firmware.lab.trial import Trial
from firmware.printable import mistakes
from firmware.signatures import BY_POLICY, UNVERIFIED
from firmware.tables import EndpointOptions, ReceptionOptions
from firmware.user.untrusted import text, within

# The first year in which this program existed: a clock before it was never set.
FIRST_YEAR, LAST_YEAR = 2024, 2100
# SUB without loss on bursts, XPUB_NODROP: all of ZeroMQ 4.2 and later; pyproject's lock has 4.3.
OLDEST_ZMQ = (4, 2)
OLDEST_PYTHON = (3, 11)
RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
PORTS = ("from_users", "to_users", "pull", "report")


class Level(Enum):
    """How a check ended."""

    OK = "ok"
    WARNING = "warning"  # runs, but not as well or not beside what is there
    PROBLEM = "problem"  # does not run


class Finding(NamedTuple):
    """One line of the doctor; remedy says what to do, and is empty where there is nothing to."""

    level: Level
    subject: str
    text: str
    remedy: str = ""


def versions(
    python: tuple[int, ...] = sys.version_info[:3], libzmq: tuple[int, int, int] = zmq.zmq_version_info()
) -> Iterator[Finding]:
    """Python, ZeroMQ, kernel."""
    told = f"Python {python[0]}.{python[1]}.{python[2]}, pyzmq {zmq.pyzmq_version()}, Linux {platform.release()}"
    is_old = python[:2] < OLDEST_PYTHON
    yield Finding(
        Level.PROBLEM if is_old else Level.OK, "versions", told, "take Python 3.11 or later" if is_old else ""
    )
    told = "ZeroMQ {}.{}.{}".format(*libzmq)
    is_old = libzmq[:2] < OLDEST_ZMQ
    yield Finding(Level.PROBLEM if is_old else Level.OK, "versions", told, "take libzmq 4.2 or later" if is_old else "")


def clock(now: float, is_monotonic: bool = time.get_clock_info("monotonic").monotonic) -> Iterator[Finding]:
    """The wall clock, which time stamps come from, and the one that timers run on; now is Unix time."""
    stamp = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(now))
    if FIRST_YEAR <= time.gmtime(now).tm_year < LAST_YEAR:
        yield Finding(Level.OK, "clock", stamp)
    else:
        yield Finding(
            Level.PROBLEM,
            "clock",
            f"it is said to be {stamp}: receivers discard messages with such time stamps",
            "set it: timedatectl set-ntp true, or let GNSS set it",
        )
    if not is_monotonic:
        yield Finding(Level.PROBLEM, "clock", "the monotonic clock goes back", "take another kernel clock source")


def endpoint(
    wanted: EndpointOptions, running: Mapping[str, object] | None, is_served: bool = False
) -> Iterator[Finding]:
    """Whether the station's ports can be had, and who has those that cannot.

    running    the status of a station of ours that has them.
    is_served  the very station that is looked at is a service, and runs: they are its own.
    """
    host = wanted.address
    try:
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.bind((host, 0))
    except OSError as error:
        why = error.strerror or str(error)
        remedy = "set endpoint.address to an address of this machine (ip -brief address), or :: for all"
        yield Finding(Level.PROBLEM, "endpoint", f"address {host} cannot be listened on: {why}", remedy)
        return
    taken = [port for port in (getattr(wanted, key) for key in PORTS) if not ports.is_free(host, port)]
    numbers = ", ".join(map(str, taken))
    if not taken:
        numbers = ", ".join(str(getattr(wanted, key)) for key in PORTS)
        yield Finding(Level.OK, "endpoint", f"ports {numbers} of {host} are free")
    elif is_served:
        yield Finding(Level.OK, "endpoint", f"ports {numbers} of {host} are the running station's")
    elif running is not None:
        remedy = "a second station needs ports of its own: --set endpoint.from_users=PORT and so on"
        yield Finding(Level.WARNING, "endpoint", f"ports {numbers} of {host} belong to {ports.holder(running)}", remedy)
    else:
        remedy = f"end what has them (ss -ltnp 'sport = :{taken[0]}'), or set endpoint.{_key(wanted, taken[0])}"
        yield Finding(Level.PROBLEM, "endpoint", f"ports {numbers} of {host} are taken by another program", remedy)


def _key(wanted: EndpointOptions, port: int) -> str:
    return next(key for key in PORTS if getattr(wanted, key) == port)


def interface(
    one: InterfaceConfig, mac: bytes, running: Mapping[str, object] | None, is_service: bool = False
) -> Iterator[Finding]:
    """Whether an interface could start: its driver is started for a moment and stopped.

    running     the status of a station of ours that runs already, and has the device: it is asked instead.
    is_service  the station is another user's, who may do what this one may not.
    """
    subject = f"interface {one.name}"
    if running is not None and (told := within(within(running, "interfaces"), one.name)):
        yield _running(subject, told)
        return
    trial = Trial(one.name)
    driver = DRIVERS[one.queue.driver](one.options, Shared(mac))
    try:
        trial.run(driver)
    except StationError as error:
        if is_service and isinstance(error.__cause__, PermissionError):
            yield Finding(Level.OK, subject, f"{one.queue.driver}: only the service may try it: {error.message}")
            return
        remedy = error.hint or f"see the options of [interfaces.{one.name}]"
        yield Finding(Level.PROBLEM, subject, f"{one.queue.driver}: {error.message}", remedy)
        return
    if trial.is_up:
        yield Finding(Level.OK, subject, f"{one.queue.driver}: {trial.why}")
    else:
        remedy = "the station starts and waits for the link"
        yield Finding(Level.WARNING, subject, f"{one.queue.driver}: its link is down: {trial.why}", remedy)


def _running(subject: str, told: dict[str, object]) -> Finding:
    driver, state, why = text(told, "driver"), text(told, "state"), text(told, "why")
    level = {"up": Level.OK, "waiting": Level.PROBLEM}.get(state, Level.WARNING)
    remedy = "" if state == "up" else text(told, "hint") or "`captain status` and the station's journal say more"
    return Finding(level, subject, f"{driver}: {state} in the running station: {why}", remedy)


def pin_file(one: InterfaceConfig) -> Iterator[Finding]:
    """The file with a card's PIN, where an interface names one: others must not read it."""
    if not (name := getattr(one.options, "pin_file", "")):
        return
    subject, path = f"interface {one.name}", Path(name)
    try:
        mode = path.stat().st_mode & 0o777
    except OSError as error:
        remedy = f"write the PIN into it: install -m 600 /dev/stdin {path}"
        yield Finding(Level.PROBLEM, subject, f"pin_file {path}: {error.strerror}", remedy)
        return
    if mode & 0o077:
        yield Finding(Level.WARNING, subject, f"pin_file {path} has mode {mode:04o}", f"chmod 600 {path}")


def neighbours(board: Board, running: Mapping[str, object] | None) -> Iterator[Finding]:
    """Whether simulated neighbours, and a simulated radio that hears them, can have the ports of the board file."""
    for key in ("listen", "to") if board.simulated else ("listen",):
        if board.neighbours is None:
            return
        place = getattr(board.neighbours, key)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(address(place))
            except OSError as error:
                level = Level.PROBLEM if running is None else Level.WARNING
                remedy = f"give neighbours.{key} in the board file another port, or 0 for any that is free"
                yield Finding(level, "neighbours", f"{place}: {error.strerror}", remedy)


def signatures(reception: ReceptionOptions) -> Iterator[Finding]:
    """The policy for signed messages, as long as the station verifies none."""
    told = f"{UNVERIFIED}: {BY_POLICY[reception.unverified]} (reception.unverified)"
    yield Finding(Level.OK, "security", told)


def receive_buffer(interfaces: Sequence[InterfaceConfig], rmem_max: Path = RMEM_MAX) -> Iterator[Finding]:
    """Whether the kernel lets a socket keep what its interface asks for; a burst beyond it is lost."""
    asked = max((_buffer_of(one.options) for one in interfaces), default=0)
    if not asked:
        return
    try:
        most = int(rmem_max.read_text())
    except (OSError, ValueError):
        yield Finding(Level.WARNING, "kernel", f"{rmem_max} cannot be read", "is /proc mounted?")
        return
    if most >= asked:
        yield Finding(Level.OK, "kernel", f"net.core.rmem_max is {most}, enough for buffers of {asked} octets")
    else:
        yield Finding(
            Level.WARNING,
            "kernel",
            f"net.core.rmem_max is {most}: without CAP_NET_ADMIN the receive buffer of {asked} octets is cut to it",
            f"sysctl -w net.core.rmem_max={asked}",
        )


def _buffer_of(options: Any) -> int:
    return int(getattr(options, "receive_buffer", 0))


def worker(echo: Callable[[], str]) -> Iterator[Finding]:
    """Whether a child process of this program starts and answers; echo raises StationError if not."""
    try:
        yield Finding(Level.OK, "worker", echo())
    except StationError as error:
        yield Finding(
            Level.PROBLEM, "worker", error.message, error.hint or "is there memory, and may it start processes?"
        )


def codec(load: Callable[[], Library]) -> Iterator[Finding]:
    """Whether the message library is here, and which messages it has; load raises NoLibraryError if not."""
    try:
        known = load().all()
    except NoLibraryError as error:
        told = f"{error.message}; decode, encode, explain and the fields of listen need it, a station does not"
        yield Finding(Level.WARNING, "messages", told, error.hint)
        return
    types: dict[str, list[str]] = {}
    for message in sorted(known, key=lambda one: (one.type, one.rank)):
        types.setdefault(message.type, []).append(message.name.removeprefix(f"{message.type}-"))
    held = ", ".join(f"{kind} {' '.join(editions)}" for kind, editions in types.items())
    yield Finding(Level.OK, "messages", f"{len(known)} in the library: {held}")


def configuration(read: Callable[[], Config]) -> tuple[Config | None, list[Finding]]:
    """The configuration and what is to be said about it; None where it cannot be used."""
    try:
        config = read()
    except StationError as error:
        *rest, last = mistakes(error)
        found = [Finding(Level.PROBLEM, "configuration", line) for line in rest]
        return None, [*found, Finding(Level.PROBLEM, "configuration", last, error.hint)]
    names = ", ".join(f"{one.name} ({one.queue.driver})" for one in config.interfaces)
    if names:
        return config, [Finding(Level.OK, "configuration", f"interfaces {names}")]
    remedy = "give the station an [interfaces.NAME] with a driver, or take --board sim"
    return config, [Finding(Level.WARNING, "configuration", "it has no interface", remedy)]
