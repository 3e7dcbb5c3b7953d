"""What the time of a station comes from, looked at one thing at a time: each check gives findings with a remedy."""

import os
import socket
import stat
from collections.abc import Iterator, Mapping
from contextlib import closing

from board.description import PulseDescription
from board.errors import InterfaceError
from board.leap_list import day
from board.leaps import RECEIVER, known
from board.loop import Loop
from board.machine import REAL, Machine
from drivers import DRIVERS
from drivers.contract import Can, Shared
from firmware import receivers
from firmware.config import Config
from firmware.lab.checks import Finding, Level
from firmware.pulse_input import source
from firmware.user.clock import title
from firmware.user.untrusted import text, within
from pps.pulse import Pulse, read_clocks

NO_CHRONY = (
    'start chronyd with a line `refclock SOCK` for it, before the station or after; README, "Time", has the line'
)


def time(
    config: Config, running: Mapping[str, object] | None, now: float, machine: Machine = REAL
) -> Iterator[Finding]:
    """Pulses with their receiver, chronyd's socket, leap seconds; nothing of what this configuration does not use.

    running  the status of a station of ours that has the input: it is asked instead.
    now      Unix time.
    """
    clock, receiver = within(running or {}, "clock"), _receiver(config)
    if config.board.pulse is not None:
        yield from _running(clock) if clock else _pulses(config.board.pulse, receiver, machine)
    if config.tables.time.chrony:
        yield _chrony(config.tables.time.chrony)
    if receiver and text(within(clock, "leap"), "table") != RECEIVER:
        yield _leap_seconds(config.tables.time.leap_list, now)


class _Unheard:
    """pps.pulse.Above for a moment."""

    def pulse(self, pulse: Pulse) -> None: ...

    def missed(self, count: int) -> None: ...

    def failed(self, error: InterfaceError) -> None: ...


def _receiver(config: Config) -> str:
    """Its interface; empty where none announces pulses."""
    drivers = {one.name: DRIVERS[one.queue.driver](one.options, Shared(config.mac)) for one in config.interfaces}
    announcing = [name for name, driver in drivers.items() if Can.TIMEMARK in driver.capabilities.can]
    return receivers.chosen(config.tables.time, config.board.pulse, announcing)


def _pulses(pulse: PulseDescription, receiver: str, machine: Machine) -> Iterator[Finding]:
    """Whether the input can be opened, and a receiver drives it."""
    if not receiver:
        remedy = 'an interface with driver = "zed_f9p" and pulse = true, if a receiver is there'
        yield Finding(Level.OK, "pulses", f"{pulse.where} is not used: no interface announces pulses", remedy)
        return
    if pulse.kind:
        yield Finding(Level.OK, "pulses", f"simulated, of {receiver}; `captain selftest` tries them")
        return
    with closing(Loop()) as loop:
        made = source(loop, pulse, machine.dev, _Unheard(), read_clocks)
        try:
            made.start()
        except InterfaceError as error:
            # What is there and may be read, and is no input, becomes none by itself.
            is_wrong = bool(pulse.device) and os.access(pulse.device, os.R_OK)
            level = Level.PROBLEM if is_wrong else Level.WARNING
            yield Finding(level, "pulses", f"{error.message}; time is that of messages", error.hint)
            return
        made.stop()
    yield Finding(Level.OK, "pulses", f"{pulse.where} can be opened; {receiver} announces them")


def _running(clock: Mapping[str, object]) -> Iterator[Finding]:
    pulse = within(clock, "pulse")
    if text(pulse, "why"):
        yield Finding(Level.WARNING, "pulses", f"{text(pulse, 'why')}, in the running station", text(pulse, "hint"))
    is_well = text(clock, "state") in ("locked", "settling")
    remedy = "" if is_well else text(clock, "missing") or "`captain time` says more"
    yield Finding(Level.OK if is_well else Level.WARNING, "time", title(clock).removeprefix("time "), remedy)


def _chrony(path: str) -> Finding:
    if not os.path.exists(path):
        return Finding(Level.WARNING, "chrony", f"{path} does not exist: chronyd is not fed", NO_CHRONY)
    if not stat.S_ISSOCK(os.stat(path).st_mode):
        return Finding(Level.PROBLEM, "chrony", f"{path} is no socket: chronyd is not fed", NO_CHRONY)
    if not os.access(path, os.W_OK):
        remedy = 'chronyd makes it for root alone: a drop-in for its unit gives it to a group; README, "Time"'
        return Finding(Level.WARNING, "chrony", f"{path} may not be written to by this user", remedy)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        if number := probe.connect_ex(path):
            what = f"{path}: nobody takes samples there: {os.strerror(number)}"
            return Finding(Level.WARNING, "chrony", what, NO_CHRONY)
    return Finding(Level.OK, "chrony", f"{path} takes samples")


def _leap_seconds(path: str, now: float) -> Finding:
    leaps = known(path, now)
    if leaps.doubt:
        remedy = "apt install --only-upgrade tzdata; a receiver that sees satellites knows better than any list"
        return Finding(Level.WARNING, "leap seconds", leaps.doubt, remedy)
    until = "" if leaps.expires is None else f", until {day(leaps.expires)}"
    return Finding(Level.OK, "leap seconds", f"by {leaps.source}{until}")
