"""What chronyd is configured with: one line beside a system's own configuration, or the whole of it for the image."""

from board.leaps import LIST
from pps.chrony import SOCKET, check_path
from pps.model import LATENCY_NS, unseen_latency_ns

SOURCES = "/etc/chrony/sources.d"

# Figures: python -m tests.pps.chronyd_check.
_REFCLOCK = """\
# A complete sample of each second that the receiver has confirmed.
# poll 2, filter 4: the median part of 4 samples every 4 s. Errors of 0.6 to 2.2 us in 95 %, a step of 500 us followed
#   in 19 to 39 s; 3 and 8 need 49 s for the same, and 0 and 1, which average no late pulse away, up to 65 s for 5 us.
# delay: chronyd counts half of it as what it cannot see. The middle of what stamps are late is taken off each sample;
#   what they may be earlier or later than that, all the time, is this half.
# prefer, not trust: servers that agree with each other may outvote a receiver that is lied to.
refclock SOCK {path} refid PPS poll 2 filter 4 delay {delay_s:.1e} prefer
"""

_WHOLE = """\
# Written by captain for the image.
{refclock}
# Servers that the owner names, for a box without a receiver, or until it sees the sky: {sources}/*.sources.
sourcedir {sources}

# Without a battery the clock starts anywhere: it is stepped while nobody leans on it, and slewed from then on.
makestep 0.1 3
maxupdateskew 100

# The kernel's state says "synchronised" only with this, for systemd's time-sync.target and for who asks adjtimex(2);
# that there is no clock to copy the time to does no harm.
rtcsync

# TAI for CLOCK_TAI, and leap seconds that no receiver has announced; one that a receiver announces needs no list.
{leaps}

# What is learned of the oscillator. Samples are not kept: what they were taken against is gone with the power.
driftfile {state}/chrony.drift

# No NTP for others. Commands on loopback alone, where chronyc may ask without rights and change nothing.
port 0
bindcmdaddress 127.0.0.1
bindcmdaddress ::1
"""

_ACCESS = """\
# chronyd makes the socket as root and for root alone, at each of its starts.
[Service]
ExecStartPost=+/bin/chgrp {group} {path}
ExecStartPost=+/bin/chmod 0620 {path}
"""


def refclock(path: str = SOCKET, latency_ns: int = LATENCY_NS) -> str:
    """For /etc/chrony/conf.d/captain.conf, beside a chrony.conf that stays as it is.

    A source and nothing else: Debian 12's chrony.conf reads that folder first and overrides what it says of the rest.

    path        of the socket, as in [time] chrony of captain.toml; raises ConfigurationError where it cannot be one.
    latency_ns  that of the board file's [pulse]: the most that an ordinary stamp is late.
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
    """The whole chrony.conf of the image.

    leaps    a leap-seconds.list (chronyd 4.6 and later), or a timezone that holds leap seconds, such as right/UTC.
    state    directory of chronyd's user: what it has learned of the oscillator.
    sources  directory of files with servers, a `server HOST iburst` a line; it need not be there.
    """
    directive = "leapseclist" if leaps.startswith("/") else "leapsectz"
    return _WHOLE.format(
        refclock=refclock(path, latency_ns), leaps=f"{directive} {leaps}", state=state, sources=sources
    )


def access(group: str, path: str = SOCKET) -> str:
    """For /etc/systemd/system/chrony.service.d/captain.conf where the station does not run as root.

    group  of the station's user: it may write to the socket, and nobody else.
    """
    return _ACCESS.format(group=group, path=path)
