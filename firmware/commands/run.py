"""captain run: runs the station in the foreground until SIGTERM or Ctrl-C."""

import argparse
import logging
import resource
import signal
import sys

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.runtime.signals import Signals
from firmware.client.arguments import add_configuration
from firmware.config import captain_toml
from firmware.endpoint.peers.limits import raise_descriptors
from firmware.printable import clean
from firmware.station.station import Station

DESCRIPTION = """\
Runs a station, which connects user programs with V2X interfaces.

SIGTERM and Ctrl-C send what is queued and stop the station within a second.
SIGHUP reloads the policy; connections stay. As a service (Type=notify) the
station reports readiness to systemd and feeds its watchdog.
"""
EPILOG = """\
examples:
  captain run                           simulated board, default ports
  captain run --config captain.toml     interfaces and policy of a file
  captain run --set endpoint.address=0.0.0.0
        programs of other machines may connect
  captain run --board none --set interfaces.air.driver=udp --set interfaces.air.listen=127.0.0.1:9001
        one interface, no simulation
  captain run --board quad              a Pi under a Quad Expander
  captain run --board ./crowd.toml      a board file of your own

The message types that `captain-asn1 add` has registered count as rows of
[[types]]: ~/.config/captain/types.toml and /etc/captain/types.toml, or the file
that CAPTAIN_TYPES names.

exit codes:
  0    stopped as asked
  1    could not start
  2    wrong usage
"""

LEAST_DESCRIPTORS = 64  # the simulated board needs 30, and each user one more
ENOUGH = "raise the hard limit: LimitNOFILE=1024 in the unit, or nofile in /etc/security/limits.conf"


class Prefixed(logging.Formatter):
    """Formats each line of a message with logger name and level, so that a search finds every line.

    Control characters are escaped, because text of a peer may contain some.

    has_times  begin each line with its local time to the millisecond.
    """

    def __init__(self, has_times: bool = False) -> None:
        super().__init__()
        self._has_times = has_times

    def format(self, record: logging.LogRecord) -> str:
        lines = super().format(record).split("\n")
        stamp = f"{self.formatTime(record, '%H:%M:%S')}.{int(record.msecs):03} " if self._has_times else ""
        return "\n".join(f"{stamp}{record.name}: {record.levelname}: {clean(line)}" for line in lines)


def arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument("--log", default="info", choices=("debug", "info", "warning", "error"), help="to stderr")


def main(arguments: argparse.Namespace) -> int:
    """Run a station until SIGTERM or SIGINT.

    Raises StationError if the hard limit of descriptors is too low.
    """
    journal = logging.StreamHandler(sys.stderr)
    # A terminal gets times; systemd's journal, which is a socket, adds times of its own. JOURNAL_STREAM cannot tell
    # them apart, because terminals of a desktop session inherit it.
    journal.setFormatter(Prefixed(has_times=sys.stderr.isatty()))
    logging.basicConfig(level=arguments.log.upper(), handlers=[journal])

    _check_descriptors()
    source = captain_toml.ConfigSource(
        arguments.config, tuple(arguments.overrides), arguments.board, arguments.defaults
    )
    wanted = source.load()
    for path in wanted.types:
        logging.getLogger("captain").info("registered message types of %s", path)
    raise_descriptors()
    loop = Loop()
    station = Station(loop, wanted, source)
    Signals(loop, {signal.SIGTERM: station.stop, signal.SIGINT: station.stop, signal.SIGHUP: station.reread})
    try:
        station.start()
        endpoint = wanted.tables.endpoint
        address = f"[{endpoint.address}]" if ":" in endpoint.address else endpoint.address
        logging.getLogger("captain").info(
            "%s is ready: users send to tcp://%s:%d and receive from tcp://%s:%d",
            wanted.tables.station.name,
            address,
            endpoint.from_users,
            address,
            endpoint.to_users,
        )
        loop.run()
    finally:
        station.close()
        # A second signal while the process ends must not change its exit status.
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
    return 0


def _check_descriptors() -> None:
    """Check the limit of file descriptors. Raises StationError if it is too low: with fewer than ten, libzmq aborts."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    if 0 <= most < LEAST_DESCRIPTORS:  # RLIM_INFINITY is -1
        raise StationError(
            f"file descriptors: hard limit {most} is too low; a station needs {LEAST_DESCRIPTORS}", ENOUGH
        )
