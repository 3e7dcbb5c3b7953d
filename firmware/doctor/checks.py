"""Checks of configuration, ports, interfaces and message library, with remedies."""

import errno
import platform
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import zmq

from board.runtime.address import address
from board.runtime.errors import StationError
from drivers import DRIVERS
from drivers.contract import Shared
from firmware.codec.library import Library, NoLibraryError
from firmware.config.board_file import Board
from firmware.config.captain_toml import Config, InterfaceConfig
from firmware.config.tables import EndpointOptions, ReceptionOptions
from firmware.doctor.finding import Finding, Level
from firmware.doctor.trial import Trial
from firmware.lab import ports
from firmware.printable import mistakes
from firmware.station.signatures import BY_POLICY, UNVERIFIED
from firmware.untrusted import text, within

# This program exists since 2024: a clock with an earlier year was never set.
FIRST_YEAR, LAST_YEAR = 2024, 2100
# XPUB_NODROP, which lets SUB sockets receive bursts without loss, exists since ZeroMQ 4.2; pyproject's lock has 4.3.
OLDEST_ZMQ = (4, 2)
OLDEST_PYTHON = (3, 11)
RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
PORTS = ("from_users", "to_users", "pull", "report")
# Another process has the UDP port (EADDRINUSE), the device (EBUSY), or the lock of the serial port (EAGAIN).
HELD = (errno.EADDRINUSE, errno.EBUSY, errno.EAGAIN)


def versions(
    python: tuple[int, ...] = sys.version_info[:3], libzmq: tuple[int, int, int] = zmq.zmq_version_info()
) -> Iterator[Finding]:
    """Yield findings on the versions of Python, ZeroMQ and the kernel."""
    told = f"Python {python[0]}.{python[1]}.{python[2]}, pyzmq {zmq.pyzmq_version()}, Linux {platform.release()}"
    is_old = python[:2] < OLDEST_PYTHON
    yield Finding(
        Level.PROBLEM if is_old else Level.OK, "versions", told, "take Python 3.11 or later" if is_old else ""
    )
    told = "ZeroMQ {}.{}.{}".format(*libzmq)
    is_old = libzmq[:2] < OLDEST_ZMQ
    yield Finding(Level.PROBLEM if is_old else Level.OK, "versions", told, "take libzmq 4.2 or later" if is_old else "")


def clock(now: float, is_monotonic: bool = time.get_clock_info("monotonic").monotonic) -> Iterator[Finding]:
    """Yield findings on the wall clock, from which time stamps come, and on the monotonic clock, on which timers run.

    now  Unix time in seconds.
    """
    stamp = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(now))
    if FIRST_YEAR <= time.gmtime(now).tm_year < LAST_YEAR:
        yield Finding(Level.OK, "clock", stamp)
    else:
        yield Finding(
            Level.PROBLEM,
            "clock",
            f"this machine's clock shows {stamp}: receivers discard messages with such time stamps",
            "set it: timedatectl set-ntp true, or let GNSS set it",
        )
    if not is_monotonic:
        yield Finding(Level.PROBLEM, "clock", "the monotonic clock goes back", "take another kernel clock source")


def endpoint(
    wanted: EndpointOptions, running: Mapping[str, object] | None, is_served: bool = False
) -> Iterator[Finding]:
    """Check whether the station's ports are free; name the program that uses them.

    running    status of a running station that has these ports; None: no such station.
    is_served  the checked station itself runs as a service, so that it may use the ports.
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
        remedy = f"end that program (ss -ltnp 'sport = :{taken[0]}'), or set endpoint.{_key(wanted, taken[0])}"
        yield Finding(Level.PROBLEM, "endpoint", f"ports {numbers} of {host} are taken by another program", remedy)


def _key(wanted: EndpointOptions, port: int) -> str:
    return next(key for key in PORTS if getattr(wanted, key) == port)


def has_other(running: Mapping[str, object], digest: str) -> bool:
    """Return whether the station with this status runs another configuration than the one with this digest."""
    return text(running, "configuration") not in ("", digest)


def interface(
    one: InterfaceConfig,
    mac: bytes,
    running: Mapping[str, object] | None,
    is_service: bool = False,
    is_beside: bool = False,
) -> Iterator[Finding]:
    """Check whether an interface can start, by starting its driver for a moment.

    running     status of a running station that has the interface: its state is reported instead of a trial.
    is_service  the station runs as another user, who may have permissions that this user lacks.
    is_beside   a station with another configuration runs on the ports: it may hold the interface's port or device.
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
            yield Finding(Level.OK, subject, f"{one.queue.driver}: only the service may open it: {error.message}")
            return
        if is_beside and getattr(error.__cause__, "errno", None) in HELD:
            what = f"{one.queue.driver}: not checked, because the running station uses it with another configuration"
            yield Finding(Level.WARNING, subject, what, "restart it")
            return
        remedy = error.hint or f"see the options of [interfaces.{one.name}]"
        yield Finding(Level.PROBLEM, subject, f"{one.queue.driver}: {error.message}", remedy)
        return
    if trial.is_up:
        yield Finding(Level.OK, subject, f"{one.queue.driver}: {trial.why}")
    else:
        remedy = "the station starts and waits for the link"
        state = "starting" if trial.is_starting else "its link is down"
        yield Finding(Level.WARNING, subject, f"{one.queue.driver}: {state}: {trial.why}", remedy)


def _running(subject: str, told: dict[str, object]) -> Finding:
    driver, state, why = text(told, "driver"), text(told, "state"), text(told, "why")
    level = {"up": Level.OK, "waiting": Level.PROBLEM}.get(state, Level.WARNING)
    remedy = "" if state == "up" else text(told, "hint") or "`captain status` and the station's journal say more"
    return Finding(level, subject, f"{driver}: {state} in the running station: {why}", remedy)


def pin_file(one: InterfaceConfig) -> Iterator[Finding]:
    """Check that the file with a SIM card's PIN exists and that other users cannot read it."""
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
    """Check that the ports of the board file's simulated neighbours and of the radio that hears them are free."""
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
    """Yield the policy for signed messages: the station verifies no signatures."""
    told = f"{UNVERIFIED}: {BY_POLICY[reception.unverified]} (reception.unverified)"
    yield Finding(Level.OK, "security", told)


def receive_buffer(interfaces: Sequence[InterfaceConfig], rmem_max: Path = RMEM_MAX) -> Iterator[Finding]:
    """Check that the kernel permits the receive buffers that interfaces request: a burst beyond a buffer is lost."""
    asked = max((_buffer_of(one.options) for one in interfaces), default=0)
    if not asked:
        return
    try:
        most = int(rmem_max.read_text())
    except (OSError, ValueError):
        yield Finding(Level.WARNING, "kernel", f"{rmem_max} cannot be read", "mount /proc")
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
    """Check that a child process of this program starts and answers; echo raises StationError if it does not."""
    try:
        yield Finding(Level.OK, "worker", echo())
    except StationError as error:
        yield Finding(
            Level.PROBLEM, "worker", error.message, error.hint or "check the free memory and the limit of processes"
        )


def codec(load: Callable[[], Library]) -> Iterator[Finding]:
    """Check that the message library is installed, and list its messages.

    load raises NoLibraryError if the library is missing.
    """
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
    """Return the configuration and findings on it; None in place of an invalid configuration."""
    try:
        config = read()
    except StationError as error:
        *rest, last = mistakes(error)
        found = [Finding(Level.PROBLEM, "configuration", line) for line in rest]
        return None, [*found, Finding(Level.PROBLEM, "configuration", last, error.hint)]
    registered = [Finding(Level.OK, "configuration", f"registered message types of {path}") for path in config.types]
    names = ", ".join(f"{one.name} ({one.queue.driver})" for one in config.interfaces)
    if names:
        return config, [Finding(Level.OK, "configuration", f"interfaces {names}"), *registered]
    remedy = "give the station an [interfaces.NAME] with a driver, or take --board sim"
    return config, [Finding(Level.WARNING, "configuration", "it has no interface", remedy), *registered]
