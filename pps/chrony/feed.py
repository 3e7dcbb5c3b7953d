"""Samples for chronyd: one per confirmed second, to its SOCK reference clock.

chronyd steers the clock. It accepts samples up to two polling intervals old (refclock.c, valid_sample_time): its own
driver of /dev/ppsN delivers them up to a second late. The receiver confirms a second about 100 ms after the pulse.
"""

import errno
import logging
import socket
import struct
from collections import Counter
from enum import StrEnum

from board.runtime.address import check_socket_path
from board.runtime.describe import at_key
from board.runtime.errors import ConfigurationError
from board.runtime.journal import Journal
from board.time.scales import LeapEvent
from pps.pulse import Clocks, Pulse

# struct sock_sample of refclock_sock.c: tv_sec, tv_usec, offset in seconds, pulse, leap, padding, magic. This is its
# form with a time_t of 64 bits. Where time_t has 32 bits, chronyd 4.4 and later accept it beside the shorter form.
_SAMPLE = struct.Struct("@qqdiiii")
_MAGIC = 0x534F434B

# Debian's AppArmor profile permits chronyd `@{run}/chrony.*.sock` and files in /run/chrony. That folder is closed to
# all but chronyd's user (RuntimeDirectoryMode=0700 of its unit).
SOCKET = "/run/chrony.captain.sock"

# chronyd drops samples within 5 s of a leap second (LEAP_SECOND_CLOSE of reference.c). The kernel executes the leap
# second at a tick after its end, and until then its stamps are one second off.
LEAP_QUIET_S = 5
# NTP's leap bits mean "on this day" (RFC 5905, figure 9), and chronyd evaluates them only on 30 June and 31 December.
# Earlier announcements would have no effect.
ANNOUNCE_S = 86_400
# CLOCK_REALTIME and CLOCK_MONOTONIC are slewed alike, and only the former is stepped. So a step shows in their
# difference.
STEP_NS = 10_000  # difference of two readings without a step
MAX_AGE_NS = 2 * 10**9  # oldest sample that is sent; by then, the next second is confirmed too

INSERT, DELETE = 1, 2  # values of sock_sample.leap


class Fate(StrEnum):
    """Outcome of a sample."""

    SENT = "sent"
    ABSENT = "absent"
    REFUSED = "refused"
    FORBIDDEN = "forbidden"
    FULL = "full"
    OTHER = "other"
    OLD = "old"
    STEPPED = "stepped"
    LEAP = "leap"


MEANING = {
    Fate.SENT: "sent",
    Fate.ABSENT: "no socket: chronyd is not running, or its configuration has no line `refclock SOCK`",
    Fate.REFUSED: "nothing listens on the socket: chronyd ended, or another program made it",
    Fate.FORBIDDEN: "permission denied: chronyd's unit must chgrp the socket",
    Fate.FULL: "chronyd does not read",
    Fate.OTHER: "the system refused to send it",
    Fate.OLD: "the second was confirmed too late",
    Fate.STEPPED: "the system's clock was stepped after the pulse",
    Fate.LEAP: "within 5 s of a leap second, when stamps may be a second off",
}

_FATES = {
    errno.ENOENT: Fate.ABSENT,
    errno.ENOTDIR: Fate.ABSENT,
    errno.ECONNREFUSED: Fate.REFUSED,
    errno.EPROTOTYPE: Fate.REFUSED,
    errno.EACCES: Fate.FORBIDDEN,
    errno.EPERM: Fate.FORBIDDEN,
    errno.EAGAIN: Fate.FULL,
    errno.ENOBUFS: Fate.FULL,
}


class Refclock:
    """The station's end of a `refclock SOCK`. It never waits, and does not resend a failed sample.

    path     the socket that chronyd makes at its start. Raises ConfigurationError if chronyd cannot make it.
    journal  log for changes between samples being accepted or not, with the reason.
    counts   number of samples by outcome.
    """

    def __init__(self, path: str, journal: Journal) -> None:
        check_path(path)
        self.path = path
        self.counts: Counter[Fate] = Counter()
        self._journal = journal
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._state: Fate | None = None  # state of the socket that was logged last
        self._leap: LeapEvent | None = None  # last announced leap second

    def sample(self, pulse: Pulse, its_s: int, unix_ns: int, leap: LeapEvent | None, now: Clocks) -> bool:
        """Send chronyd the time of a pulse; return whether it was sent.

        its_s    confirmed second that the pulse begins.
        unix_ns  Unix time of the pulse in ns, minus the known part of its delay.
        leap     announced leap second.
        now      current clocks; a step of the system's clock since the pulse invalidates its stamp.
        """
        self._leap = leap or self._leap
        fate = self._objection(pulse, its_s, now)
        if fate is None:
            fate = self._send(sample(pulse.system_ns, unix_ns, leap_bits(leap, its_s)))
        self.counts[fate] += 1
        return fate is Fate.SENT

    def status(self) -> dict[str, object]:
        """Return whether chronyd accepts samples, the error if not, and the number of samples by outcome.

        path     path of the socket.
        feeds    the last sample was sent.
        why      why it was not; else empty.
        samples  number of samples, by outcome.
        """
        return {
            "path": self.path,
            "feeds": self._state is Fate.SENT,
            "why": MEANING[self._state] if self._state not in (None, Fate.SENT) else "",
            "samples": {fate.value: count for fate, count in self.counts.items()},
        }

    def close(self) -> None:
        """Close the socket; idempotent."""
        self._socket.close()

    def _objection(self, pulse: Pulse, its_s: int, now: Clocks) -> Fate | None:
        if self._leap is not None and abs(self._leap.its_s - its_s) <= LEAP_QUIET_S:
            return Fate.LEAP
        if now.raw_ns - pulse.raw_ns > MAX_AGE_NS:
            return Fate.OLD
        if abs(now.system_ns - pulse.system_ns - round((now.monotonic - pulse.monotonic) * 1e9)) > STEP_NS:
            return Fate.STEPPED
        return None

    def _send(self, octets: bytes) -> Fate:
        # The socket is not connected: the path is looked up each time, which finds a restarted chronyd.
        try:
            self._socket.sendto(octets, self.path)
        except OSError as error:
            fate = _FATES.get(error.errno or 0, Fate.OTHER)
            self._change(fate, f" ({error.strerror})")
        else:
            self._change(fate := Fate.SENT, "")
        return fate

    def _change(self, state: Fate, detail: str) -> None:
        if state is self._state:
            return
        self._state = state
        if state is Fate.SENT:
            self._journal.say(logging.INFO, f"{self.path}: chronyd accepts samples")
        else:
            self._journal.say(logging.WARNING, f"{self.path}: chronyd gets no samples: {MEANING[state]}{detail}")


def check_path(path: str) -> None:
    """Raise ConfigurationError if chronyd cannot make a socket; a colon would begin an option of its driver."""
    if not path.startswith("/") or any(mark in path for mark in " \t\n:"):
        raise ConfigurationError(
            f"time.chrony: {path!r}: chronyd cannot make a socket there",
            f"write an absolute path without blanks and colons, such as {SOCKET}",
        )
    at_key("time.chrony", check_socket_path, path)


def sample(system_ns: int, unix_ns: int, leap: int = 0) -> bytes:
    """Encode a sample: when the system's clock showed system_ns, Unix time was unix_ns.

    The offset refers to the stamp with all its nanoseconds: chronyd adds it to the sample's time in whole
    microseconds (refclock_sock.c). An offset from the truncated time would be half a microsecond too large on average.
    `pulse` is 0. With 1, chronyd reads the offset with the other sign, and needs another source for the second.
    """
    second, rest_ns = divmod(system_ns, 10**9)
    return _SAMPLE.pack(second, rest_ns // 1000, (unix_ns - system_ns) / 1e9, 0, leap, 0, _MAGIC)


def leap_bits(leap: LeapEvent | None, its_s: int) -> int:
    """Return the leap bits: 1 or 2 in the 24 hours before an announced leap second, else 0."""
    if leap is None or not 0 < leap.its_s - its_s <= ANNOUNCE_S:
        return 0
    return INSERT if leap.change > 0 else DELETE
