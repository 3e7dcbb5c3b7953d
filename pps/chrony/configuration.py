"""Configuration of chronyd: a line beside a system's own, or the image's file."""

from board.time.leaps import LIST
from pps.chrony.feed import SOCKET, check_path
from pps.model import LATENCY_NS, unseen_latency_ns

SOURCES = "/etc/chrony/sources.d"

# Figures: python -m tests.pps.chronyd_check.
_REFCLOCK = """\
# One sample per second that the receiver has confirmed.
# poll 2, filter 4: the median part of 4 samples, every 4 s. Errors of 0.6 to 2.2 us in 95 % of cases.
#   A step of 500 us is followed in 19 to 39 s. poll 3, filter 8 needs 49 s.
#   poll 0 and 1 do not average late pulses: up to 65 s to 5 us.
# delay: chronyd adds half of it to its bound. The station corrects the mean delay of stamps.
#   This half covers the remaining constant error.
# prefer, not trust: a spoofed receiver
#   can be outvoted by servers that agree with each other; trust would prevent that.
refclock SOCK {path} refid PPS poll 2 filter 4 delay {delay_s:.1e} prefer
"""

_WHOLE = """\
# Written by captain for the image.
{refclock}
# The owner's NTP servers, for a box without a receiver or before its first fix: {sources}/*.sources.
sourcedir {sources}

# Without a battery the clock starts at a wrong time. It is stepped at first, and slewed later.
makestep 0.1 3
maxupdateskew 100

# The kernel's state says "synchronised" only with this, for systemd's time-sync.target and for who asks adjtimex(2);
# without an RTC the copy to it is skipped.
rtcsync

# TAI for CLOCK_TAI, and leap seconds without a receiver's announcement.
{leaps}

# The oscillator's drift. Samples are not kept, because their time base ends with the power.
driftfile {state}/chrony.drift

# No NTP server. Commands on loopback only, where chronyc may query without rights and change nothing.
port 0
bindcmdaddress 127.0.0.1
bindcmdaddress ::1
"""

_ACCESS = """\
# chronyd creates the socket for root only, at each start.
[Service]
ExecStartPost={prefix}/bin/chgrp {group} {path}
ExecStartPost={prefix}/bin/chmod 0620 {path}
"""


def refclock(path: str = SOCKET, latency_ns: int = LATENCY_NS) -> str:
    """Return /etc/chrony/conf.d/captain.conf, for use beside an unchanged chrony.conf.

    It contains the source only: Debian 12's chrony.conf reads that folder first, then overrides other directives.

    path        the socket, as in [time] chrony of captain.toml.
    latency_ns  latency_ns of [pulse] in the board file: largest lateness of an ordinary stamp.

    Raises ConfigurationError if chronyd cannot make a socket at the path.
    """
    check_path(path)
    return _REFCLOCK.format(path=path, delay_s=2 * unseen_latency_ns(latency_ns) / 1e9)


def configuration(
    path: str = SOCKET,
    latency_ns: int = LATENCY_NS,
    leaps: str = LIST,
    state: str = "/var/lib/chrony",
    sources: str = SOURCES,
) -> str:
    """Return the complete chrony.conf of the image.

    leaps    a leap-seconds.list (chronyd 4.6 and later), or a timezone with leap seconds, such as right/UTC.
    state    directory for the learned drift of the oscillator; chronyd's user owns it.
    sources  directory of files with lines `server HOST iburst`; it may be absent.
    """
    directive = "leapseclist" if leaps.startswith("/") else "leapsectz"
    return _WHOLE.format(
        refclock=refclock(path, latency_ns), leaps=f"{directive} {leaps}", state=state, sources=sources
    )


def access(group: str, path: str = SOCKET, is_optional: bool = False) -> str:
    """Return /etc/systemd/system/chrony.service.d/captain.conf, for a station that does not run as root.

    group        group of the station's user; only its members may write to the socket.
    is_optional  chronyd starts also without the socket, which it makes only if its configuration has the source.
    """
    return _ACCESS.format(group=group, path=path, prefix="-+" if is_optional else "+")
