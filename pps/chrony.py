"""What chronyd is told: one sample for each second that is beyond doubt, in a datagram to its SOCK reference clock.

chronyd does the steering. It takes a sample of the past as long as it is no older than two of its polling intervals
(refclock.c, valid_sample_time), as its own driver of /dev/ppsN gives them up to a second late: that the receiver has
confirmed the second some 100 ms after the pulse is soon enough.
"""

import errno
import logging
import socket
import struct
from collections import Counter
from enum import StrEnum

from board.address import check_socket_path
from board.describe import at_key
from board.errors import ConfigurationError
from board.journal import Journal
from board.time import LeapEvent
from pps.pulse import Clocks, Pulse

# struct sock_sample of refclock_sock.c: tv_sec, tv_usec, offset in seconds, pulse, leap, padding, magic. Such it is
# where time_t has 64 bits, and chronyd 4.4 and later take it beside a shorter one where it has 32.
_SAMPLE = struct.Struct("@qqdiiii")
_MAGIC = 0x534F434B

# Debian's AppArmor profile lets chronyd make `@{run}/chrony.*.sock` and what is in /run/chrony, which is closed to all
# but chronyd's own user (RuntimeDirectoryMode=0700 of its unit).
SOCKET = "/run/chrony.captain.sock"

# chronyd drops what it has within 5 s of a leap second (LEAP_SECOND_CLOSE of reference.c): the kernel carries it out
# at a tick after the second's end, and until then its stamps are a second off.
LEAP_QUIET_S = 5
# The leap bits of NTP say "on this day" (RFC 5905, figure 9), and chronyd looks at them on 30 June and 31 December
# only: said sooner they change nothing.
ANNOUNCE_S = 86_400
# CLOCK_REALTIME and CLOCK_MONOTONIC are slewed alike, and only the former is stepped: by what they have gone apart.
STEP_NS = 10_000  # two readings of both are that near to each other
MAX_AGE_NS = 2 * 10**9  # beyond, the second after it has been confirmed as well

INSERT, DELETE = 1, 2  # of sock_sample.leap


class Fate(StrEnum):
    """What became of a sample."""

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
    Fate.SENT: "chronyd has it",
    Fate.ABSENT: "there is no socket: chronyd does not run, or its configuration has no line `refclock SOCK` for it",
    Fate.REFUSED: "the socket is left from a chronyd that has ended, or is no socket of chronyd",
    Fate.FORBIDDEN: "the station may not write to the socket: chronyd makes it for root alone, its unit must chgrp it",
    Fate.FULL: "chronyd does not read: it hangs",
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
    """The station's end of a `refclock SOCK`. It never waits; what was not taken is not sent again.

    path     the socket that chronyd makes at its start. Raises ConfigurationError where it cannot make one.
    journal  is told when chronyd begins to take samples, and when it ceases, and why.
    counts   samples by what became of them.
    """

    def __init__(self, path: str, journal: Journal) -> None:
        check_path(path)
        self.path = path
        self.counts: Counter[Fate] = Counter()
        self._journal = journal
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._state: Fate | None = None  # of the socket, as it was told last
        self._leap: LeapEvent | None = None  # the last one announced

    def sample(self, pulse: Pulse, its_s: int, unix_ns: int, leap: LeapEvent | None, now: Clocks) -> bool:
        """Tell chronyd what time it was at a pulse; returns whether it was sent.

        its_s    the second that the pulse begins, beyond doubt.
        unix_ns  the same moment as Unix time in ns, less what is known of the pulse's delay.
        leap     that is announced.
        now      of this call: a clock stepped since the pulse makes its stamp void.
        """
        self._leap = leap or self._leap
        fate = self._objection(pulse, its_s, now)
        if fate is None:
            fate = self._send(sample(pulse.system_ns, unix_ns, leap_bits(leap, its_s)))
        self.counts[fate] += 1
        return fate is Fate.SENT

    def status(self) -> dict[str, object]:
        """Whether samples arrive, why not, and how many of each fate."""
        return {
            "path": self.path,
            "feeds": self._state is Fate.SENT,
            "why": MEANING[self._state] if self._state not in (None, Fate.SENT) else "",
            "samples": {fate.value: count for fate, count in self.counts.items()},
        }

    def close(self) -> None:
        """Idempotent."""
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
        # Without a connection: the path is looked up each time, so that a chronyd that was started again is found.
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
            self._journal.say(logging.INFO, f"{self.path}: chronyd takes samples")
        else:
            self._journal.say(logging.WARNING, f"{self.path}: chronyd is not fed: {MEANING[state]}{detail}")


def check_path(path: str) -> None:
    """Raise ConfigurationError where chronyd cannot make a socket: options of its driver come after a colon."""
    if not path.startswith("/") or any(mark in path for mark in " \t\n:"):
        raise ConfigurationError(
            f"time.chrony: {path!r}: chronyd cannot make a socket there",
            f"an absolute path without blanks and colons, such as {SOCKET}",
        )
    at_key("time.chrony", check_socket_path, path)


def sample(system_ns: int, unix_ns: int, leap: int = 0) -> bytes:
    """A complete sample: at system_ns by the system's clock, Unix time was unix_ns.

    The offset is that of the stamp with all its nanoseconds: chronyd adds it to the microseconds of the sample's time
    (refclock_sock.c), and one made against those would be half a microsecond too large on average. `pulse` is 0:
    with 1 chronyd reads the offset with the other sign, and needs another source to tell the second.
    """
    second, rest_ns = divmod(system_ns, 10**9)
    return _SAMPLE.pack(second, rest_ns // 1000, (unix_ns - system_ns) / 1e9, 0, leap, 0, _MAGIC)


def leap_bits(leap: LeapEvent | None, its_s: int) -> int:
    """What is said of an announced leap second: 1 or 2 in the 24 hours before it, 0 otherwise."""
    if leap is None or not 0 < leap.its_s - its_s <= ANNOUNCE_S:
        return 0
    return INSERT if leap.change > 0 else DELETE
