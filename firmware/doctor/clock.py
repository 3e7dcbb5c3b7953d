"""Checks of the station's time sources, with remedies."""

import os
import socket
import stat
from collections.abc import Iterator, Mapping
from contextlib import closing

from board.description import PulseDescription
from board.machine import REAL, Machine
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from board.time.leap_list import day
from board.time.leaps import RECEIVER, known
from drivers import DRIVERS
from drivers.contract import Can, Shared
from firmware.client.show.status.clock import title
from firmware.clock import receivers
from firmware.clock.pulse_input import source
from firmware.config.captain_toml import Config
from firmware.doctor.finding import Finding, Level
from firmware.untrusted import text, within
from pps.pulse import Pulse, read_clocks

NO_CHRONY = (
    "start chronyd with a line `refclock SOCK` for it, before the station or after; pps/guide/time.md has the line"
)


def time(
    config: Config, running: Mapping[str, object] | None, now: float, machine: Machine = REAL
) -> Iterator[Finding]:
    """Yield findings on the time sources that the configuration uses: pulses, their receiver, chronyd, leap seconds.

    running  status of a running station that uses the pulse input: its state is reported instead of a trial.
    now      Unix time in seconds.
    """
    clock, receiver = within(running or {}, "clock"), _receiver(config)
    if config.board.pulse is not None:
        yield from _running(clock) if clock else _pulses(config.board.pulse, receiver, machine)
    if config.tables.time.chrony:
        yield _chrony(config.tables.time.chrony)
    if receiver and text(within(clock, "leap"), "table") != RECEIVER:
        yield _leap_seconds(config.tables.time.leap_list, now)


class _Unheard:
    """Receiver of pulse events during the trial (pps.pulse.Above); ignores all of them."""

    def pulse(self, pulse: Pulse) -> None: ...

    def missed(self, count: int) -> None: ...

    def failed(self, error: InterfaceError) -> None: ...


def _receiver(config: Config) -> str:
    """Return the interface of the receiver that announces pulses; empty without one."""
    drivers = {one.name: DRIVERS[one.queue.driver](one.options, Shared(config.mac)) for one in config.interfaces}
    announcing = [name for name, driver in drivers.items() if Can.TIMEMARK in driver.capabilities.can]
    return receivers.chosen(config.tables.time, config.board.pulse, announcing)


def _pulses(pulse: PulseDescription, receiver: str, machine: Machine) -> Iterator[Finding]:
    """Check that the pulse input can be opened and that a receiver announces its pulses."""
    if not receiver:
        remedy = 'an interface with driver = "zed_f9p" and pulse = true, if a receiver is there'
        yield Finding(Level.OK, "pulses", f"{pulse.where} is not used: no interface announces pulses", remedy)
        return
    if pulse.kind:
        yield Finding(Level.OK, "pulses", f"simulated pulses of {receiver}; `captain selftest` tests them")
        return
    with closing(Loop()) as loop:
        made = source(loop, pulse, machine.dev, _Unheard(), read_clocks)
        try:
            made.start()
        except InterfaceError as error:
            # An existing, readable device that is not a pulse input stays wrong; any other error may pass by itself.
            is_wrong = bool(pulse.device) and os.access(pulse.device, os.R_OK)
            level = Level.PROBLEM if is_wrong else Level.WARNING
            yield Finding(level, "pulses", f"{error.message}; the time comes from messages only", error.hint)
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
        return Finding(Level.WARNING, "chrony", f"{path}: absent; chronyd receives no samples", NO_CHRONY)
    if not stat.S_ISSOCK(os.stat(path).st_mode):
        return Finding(Level.PROBLEM, "chrony", f"{path}: not a socket; chronyd receives no samples", NO_CHRONY)
    if not os.access(path, os.W_OK):
        remedy = "chronyd makes it for root alone: a drop-in for its unit gives it to a group: pps/guide/time.md"
        return Finding(Level.WARNING, "chrony", f"{path} may not be written to by this user", remedy)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        if number := probe.connect_ex(path):
            what = f"{path}: chronyd does not take samples: {os.strerror(number)}"
            return Finding(Level.WARNING, "chrony", what, NO_CHRONY)
    return Finding(Level.OK, "chrony", f"{path} takes samples")


def _leap_seconds(path: str, now: float) -> Finding:
    leaps = known(path, now)
    if leaps.doubt:
        remedy = "apt install --only-upgrade tzdata; a receiver that sees satellites knows better than any list"
        return Finding(Level.WARNING, "leap seconds", leaps.doubt, remedy)
    until = "" if leaps.expires is None else f", until {day(leaps.expires)}"
    return Finding(Level.OK, "leap seconds", f"by {leaps.source}{until}")
