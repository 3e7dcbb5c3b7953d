"""captain run: the station itself, in the foreground, until it is told to stop."""

import argparse
import logging
import resource
import signal
import sys

from board.errors import StationError
from board.loop import Loop
from board.signals import Signals
from firmware import config
from firmware.peers.limits import raise_descriptors
from firmware.printable import clean
from firmware.station import Station
from firmware.user.arguments import add_configuration

DESCRIPTION = """\
Runs the station: interfaces on one side, user programs on the other.

SIGTERM and Ctrl-C drain the queues and stop within a second. SIGHUP reads the policy again and keeps connections.
Under systemd (Type=notify) it reports readiness and feeds the watchdog.
"""
EPILOG = """\
examples:
  captain run                           simulated board, default ports
  captain run --config captain.toml     interfaces and policy of a file
  captain run --set endpoint.address=0.0.0.0
        users of other machines may connect
  captain run --board none --set interfaces.air.driver=udp --set interfaces.air.listen=127.0.0.1:9001
        one interface, and nothing simulated
  captain run --board quad              a Pi on a Quad Expander; pi: one without
  captain run --board ./crowd.toml      a board file of your own: with another
                                        [neighbours] than that of sim

exit codes:
  0    stopped as asked
  1    could not start
  2    wrong usage
"""

LEAST_DESCRIPTORS = 64  # on the simulated board 30; each user takes one more
ENOUGH = "raise the hard limit: LimitNOFILE=1024 in the unit, or nofile in /etc/security/limits.conf"


class Prefixed(logging.Formatter):
    """Each line with who says it: several mistakes of a file are as many lines, and one may be searched for.

    A peer's words may be in it, and a terminal obeys some of them.
    """

    def format(self, record: logging.LogRecord) -> str:
        lines = super().format(record).split("\n")
        return "\n".join(f"{record.name}: {record.levelname}: {clean(line)}" for line in lines)


def arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument("--log", default="info", choices=("debug", "info", "warning", "error"), help="to stderr")


def main(arguments: argparse.Namespace) -> int:
    journal = logging.StreamHandler(sys.stderr)
    journal.setFormatter(Prefixed())
    logging.basicConfig(level=arguments.log.upper(), handlers=[journal])

    _check_descriptors()
    source = config.Source(arguments.config, tuple(arguments.overrides), arguments.board, arguments.defaults)
    wanted = source.load()
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
        # A second SIGTERM while the process ends must not change its exit status.
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
    return 0


def _check_descriptors() -> None:
    """Raises StationError where they are too few: below ten libzmq aborts, above that some part fails late."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    if 0 <= most < LEAST_DESCRIPTORS:  # RLIM_INFINITY is -1
        raise StationError(
            f"file descriptors: hard limit {most} is too low; a station needs {LEAST_DESCRIPTORS}", ENOUGH
        )
