"""Station and real broker, over a mobile network with many outages.

usage: python -m tests.proof.outage [--duration 1800] [--seed 1] [--keep-journal FILE]

The outages of a day come without their quiet stretches. Each of two interfaces sends a CAM every 0.1 s, and an
observer is behind the broker: all messages are accounted for. Ends with 1 when a goal is not met.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from board.runtime.errors import StationError
from drivers.reason import Reason
from firmware.client.show.table import Screen
from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.mosquitto import Mosquitto
from tests.proof.chaos.run import Goal, summary
from tests.proof.outage import pattern, process, result, watch
from tests.proof.outage.account import Account
from tests.proof.outage.link import BROKER, Link
from tests.proof.outage.messages import CAM_HZ, Schedule
from tests.proof.outage.pattern import Trouble
from tests.proof.outage.process import Samples
from tests.proof.outage.stage import TRANSIT_S, WORD_S
from tests.proof.outage.traffic import Traffic
from tests.system.ports import Ports
from tests.system.station import Station

PATHS = (("qos1", 1), ("qos0", 0))
TOPIC = "v2x/btp/+"
LISTENER = """
listener {port} {address}
cafile {authority}
certfile {server.certificate}
keyfile {server.key}
require_certificate true
"""

QUIET_S = 12.0  # before the first trouble, and after the last: longer than the longest lifetime
SAMPLE_S = 1.0
CLOSE_S = 5.0  # how often messages are closed whose time is over
TICK_S = 0.02
BURST_S = 120.0  # on average, from one to the next of more messages than a queue holds


class RealRun:
    """One run, from everything up to everything said."""

    def __init__(self, link: Link, station: Station, traffic: Traffic, troubles: Sequence[Trouble]) -> None:
        self._link = link
        self._station = station
        self._traffic = traffic
        self._troubles = troubles
        assert station.child is not None
        self.samples = Samples(station.child.pid)

    def play(self) -> None:
        self._began = time.monotonic() + QUIET_S
        self._acts = [
            (one.at_s, lambda one=one: self._begin(one)) if is_begin else (one.end_s, lambda one=one: self._end(one))
            for one in self._troubles
            for is_begin in (True, False)
        ]
        last = self._troubles[-1].end_s if self._troubles else 0.0
        self._turn(QUIET_S + last + QUIET_S, self._traffic.send)
        self._turn(QUIET_S, lambda: None)
        for account in self._traffic.accounts.values():
            account.close_old(float("inf"))

    def goals(self) -> list[Goal]:
        traffic = self._traffic
        refused = ", ".join(traffic.refused[:5]) or "none"
        goals = [Goal("no request is refused", refused, not traffic.refused)]
        accepted = traffic.requests * len(traffic.accounts)
        goals.append(Goal("each is accepted", f"{traffic.accepted} of {accepted}", traffic.accepted == accepted))
        interfaces = self._station.status()["interfaces"]
        for name, account in traffic.accounts.items():
            connections = interfaces[name]["details"]["connections"]
            goals += result.goals(account, traffic.requests, connections)
            goals += watch.goals(name, traffic.watches[name])
        goals += self.samples.goals(len(PATHS))
        for name, account in traffic.accounts.items():
            queue, count = interfaces[name]["queue"], account.sums.outcomes[Reason.QUEUE_FULL]
            seen = f"{queue['longest']} of {queue['capacity']}, {count} dropped"
            goals.append(
                Goal(
                    f"{name}: its queue was full if it says so",
                    seen,
                    not count or queue["longest"] == queue["capacity"],
                )
            )
        states = {name: one["state"] for name, one in interfaces.items()}
        goals.append(Goal("all are connected", str(states), set(states.values()) == {"up"}))
        return goals

    def _turn(self, longest_s: float, send: Callable[[], None]) -> None:
        end = time.monotonic() + longest_s
        every = {send: 1 / CAM_HZ, self._tick: TICK_S, self.samples.take: SAMPLE_S, self._close_old: CLOSE_S}
        due = dict.fromkeys(every, time.monotonic())
        while (now := time.monotonic()) < end:
            for act, at in due.items():
                if now >= at:
                    act()
                    due[act] = max(at + every[act], now - 1.0)
            self._traffic.listen(max(0.001, min(due.values()) - time.monotonic()))

    def _tick(self) -> None:
        while self._acts and time.monotonic() - self._began >= self._acts[0][0]:
            self._acts.pop(0)[1]()

    def _begin(self, trouble: Trouble) -> None:
        for one in self._traffic.watches.values():
            one.begin(time.monotonic())
        self._link.begin(trouble)

    def _end(self, trouble: Trouble) -> None:
        self._traffic.take()  # what came before it was over
        self._link.end(trouble)
        for one in self._traffic.watches.values():
            one.end(trouble, time.monotonic())

    def _close_old(self) -> None:
        for account in self._traffic.accounts.values():
            account.close_old(time.monotonic())


def broker_behind(link: Link, folder: Path, ports: Ports, authority: Authority) -> Mosquitto:
    """A started broker in its namespace, with a TLS listener at its own end of the network."""
    server = authority.server((f"IP:{BROKER}",))
    more = LISTENER.format(port=process.PORT, address=BROKER, authority=authority.certificate, server=server)
    with link.broker.inside():
        return Mosquitto(folder, ports, authority, more=more).start()


def account(name: str, qos: int, traffic_watch: Callable[[], watch.Watch]) -> Account:
    return Account(
        name,
        TRANSIT_S,
        WORD_S,
        lambda *span: traffic_watch().was_usable(*span),
        is_lossy=qos == 0,
    )


def run(wanted: argparse.Namespace, closing: ExitStack) -> bool:
    """Whether all goals are met."""
    link = Link(len(PATHS))
    folder = Path(closing.enter_context(tempfile.TemporaryDirectory(prefix="outage-")))
    ports = Ports()
    closing.callback(ports.release)
    authority = Authority(folder)
    broker = broker_behind(link, folder, ports, authority)
    closing.callback(broker.stop)
    with link.broker.inside():
        observer = Client(broker.plain_port, host="127.0.0.1").subscribe(TOPIC)
    closing.callback(observer.close)
    station = Station(folder, ports)
    closing.callback(station.kill)
    process.configured(station, folder, authority, PATHS)
    station.start()
    process.wait_until_up(station, [name for name, _ in PATHS])
    watches: dict[str, watch.Watch] = {}
    accounts = {name: account(name, qos, lambda name=name: watches[name]) for name, qos in PATHS}
    traffic = Traffic(station, observer, Schedule(wanted.seed, BURST_S), accounts)
    closing.callback(traffic.close)
    watches.update(traffic.watches)
    traffic.join()
    troubles = pattern.cut(pattern.day(wanted.seed), wanted.duration)
    one = RealRun(link, station, traffic, troubles)
    one.play()
    goals = one.goals()
    if wanted.keep_journal:
        wanted.keep_journal.write_text(station.stderr.read_text())
    station.stop()
    title = f"{wanted.duration:g} s, seed {wanted.seed}: {traffic.requests} messages by each interface"
    Screen().show(
        [
            pattern.table(f"{wanted.duration:g} s of a day without the quiet, seed {wanted.seed}", troubles),
            result.table(list(accounts.values())),
            watch.table(watches),
            summary(title, goals),
        ]
    )
    return all(goal.is_met for goal in goals)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.proof.outage", description=__doc__.partition("\n")[0])
    parser.add_argument("--duration", type=float, default=1800.0, help="seconds with outages (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the day (%(default)s)")
    parser.add_argument("--keep-journal", type=Path, help="what the station has said goes there")
    wanted = parser.parse_args(arguments)
    with ExitStack() as closing:
        try:
            return int(not run(wanted, closing))
        except StationError as error:
            hint = "run it as root, or allow user namespaces: sysctl kernel.unprivileged_userns_clone=1"
            print(f"outages: {error.message}; {hint}", file=sys.stderr)
            return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
