"""Attacks on all ports of a station, beside a good client.

usage: python -m tests.attack [--duration 60] [--captain COMMAND] [--only NAME ...]

The loop's lag is the time of an answer of the control socket, which the loop serves. A message's lag is from the air
to a subscriber, with libzmq's own thread on its way. With two processors or more, the loop's thread and the client
have the first one. The attackers and libzmq's thread have the others: a box has four.

Ends with 1 if the station ended, or a message of the good client was lost. Also if a message or the loop took 1 s,
memory grew by more than 64 MB (160 with several attacks), or descriptors leaked. From 60 s on, the p99 of the loop's
lag may be 3 times that without attacks. In less time this ratio is only shown beside its goal: the 99th of
100 is a matter of chance.
"""

import argparse
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import zmq

from tests.attack.attacks import ATTACKS
from tests.bench.subject import BINARY, SOURCE, Station

GOAL = 3.0
FULL_S = 60.0  # from this duration on GOAL is part of the verdict
LONGEST_S = 1.0
# By one attack, and by nine at once: 51 to 71 MB were seen in 60 s, freed memory that the C library keeps.
MEMORY_KB, MEMORY_ALL_KB = 64 * 1024, 160 * 1024
EVERY_S = 0.01  # between two messages of the good client, whatever the last one took
PATIENCE_S = 10.0
BODY = bytes(300)


class Lags:
    """Lags of one kind: quantiles in ms of values in seconds."""

    def __init__(self, lags: Sequence[float]) -> None:
        self._sorted = sorted(lags)

    @property
    def p99_ms(self) -> float:
        return self._sorted[int(len(self._sorted) * 0.99)] * 1000

    @property
    def longest_ms(self) -> float:
        return self._sorted[-1] * 1000


class Phase(NamedTuple):
    """Measurements of the good client: lags, counts of its messages, resident memory of the station."""

    loop: Lags
    messages: Lags
    sent: int
    received: int
    raw: int
    memory_kb: int


class Client:
    """Asks the loop, sends a CAM by UDP and takes it as v2x.cam. and raw. of a subscriber each, every 10 ms."""

    def __init__(self, station: Station, context: "zmq.Context[zmq.Socket[bytes]]") -> None:
        self._station = station
        self._control = station.control()
        self._answers = self._control.makefile("rb")
        self._air = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to = "127.0.0.1", station.ports.listen
        self._pdus, self._raws = (self._subscriber(context, topic) for topic in (b"v2x.", b"raw."))
        self._sent = 0

    def join(self) -> None:
        """Until both subscribers receive."""
        end = time.monotonic() + PATIENCE_S
        missing = {self._pdus, self._raws}
        while missing:
            assert time.monotonic() < end, "the station does not serve the good client"
            self._send()
            missing -= {one for one in missing if one.poll(20)}
        time.sleep(0.2)
        for one in (self._pdus, self._raws):
            while one.poll(0):
                one.recv_multipart()

    def run(self, duration: float) -> Phase:
        loop, messages, sent, received, raw, memory_kb = [], [], 0, 0, 0, 0
        end = time.monotonic() + duration
        while time.monotonic() < end:
            asked = time.monotonic()
            self._ask()
            began = time.monotonic()
            loop.append(began - asked)
            self._send()
            sent += 1
            if self._pdus.poll(PATIENCE_S * 1000):
                self._pdus.recv_multipart()
                received += 1
            raw += self._take_raws(0)
            messages.append(time.monotonic() - began)
            memory_kb = max(memory_kb, self._station.memory_kb())
            time.sleep(max(0.0, EVERY_S - (time.monotonic() - asked)))
        while raw < sent and (taken := self._take_raws(1000)):
            raw += taken
        return Phase(Lags(loop), Lags(messages), sent, received, raw, memory_kb)

    def _ask(self) -> None:
        """Send a command without a name, which the loop answers at once with an error."""
        self._control.sendall(b"{}\n")
        assert self._answers.readline(), "the station has closed its control socket"

    def _send(self) -> None:
        self._sent += 1
        self._air.sendto(bytes((2, 2)) + self._sent.to_bytes(4, "big") + BODY, self._to)

    def _take_raws(self, wait_ms: int) -> int:
        count = 0
        while self._raws.poll(wait_ms if not count else 0):
            self._raws.recv_multipart()
            count += 1
        return count

    def _subscriber(self, context: "zmq.Context[zmq.Socket[bytes]]", topic: bytes) -> "zmq.Socket[bytes]":
        subscriber = context.socket(zmq.SUB)
        subscriber.linger = 0
        subscriber.subscribe(topic)
        subscriber.connect(f"tcp://127.0.0.1:{self._station.ports.to_users}")
        return subscriber


def divide_processors(station: Station) -> set[int]:
    """Give the first processor to the loop's thread and this client; return the others, where there are some."""
    first, *others = sorted(os.sched_getaffinity(0))
    if not others:
        return {first}
    for thread in map(int, os.listdir(f"/proc/{station.process.pid}/task")):
        os.sched_setaffinity(thread, {first} if thread == station.process.pid else others)
    os.sched_setaffinity(0, {first})
    return set(others)


@contextmanager
def attacking(station: Station, names: Sequence[str], processors: set[int]) -> Iterator[None]:
    """All of them as processes, each at each of its ports, which have what others leave of some processors."""
    with ExitStack() as ending:
        for name in names:
            for port in ATTACKS[name][1]:
                number = getattr(station.ports, port)
                command = ["chrt", "--idle", "0", sys.executable, "-m", "tests.attack.attacks", name, str(number)]
                one = subprocess.Popen(command)
                os.sched_setaffinity(one.pid, processors)
                ending.callback(one.wait)
                ending.callback(one.kill)
        yield


def main() -> int:
    options = arguments()
    with Station(captain=options.captain) as station, zmq.Context() as context:
        client = Client(station, context)
        client.join()
        descriptors = count_descriptors(station)
        processors = divide_processors(station)
        quiet = client.run(options.duration)
        with attacking(station, options.only, processors):
            attacked = client.run(options.duration)
        is_released = until(lambda: count_descriptors(station) <= descriptors)
        is_alive = station.process.poll() is None
        drops = station.status()["drops"] if is_alive else []
        context.destroy(0)
    show(quiet, attacked)
    for row in drops:
        print(f"  {row['where']:12}{row['reason']:22}{row['count']:8}")
    wrong = faults(quiet, attacked, is_alive, is_released, len(options.only), options.duration)
    print(f"NOT held: {'; '.join(wrong)}" if wrong else "alive, no message lost, descriptors released")
    return 1 if wrong else 0


def faults(
    quiet: Phase, attacked: Phase, is_alive: bool, is_released: bool, attacks: int, duration: float
) -> list[str]:
    """Return what was not held."""
    grown_kb, most_kb = attacked.memory_kb - quiet.memory_kb, MEMORY_KB if attacks == 1 else MEMORY_ALL_KB
    ratio = growth(quiet.loop, attacked.loop)
    held = {
        "the station ended": is_alive,
        "the good client lost messages": min(attacked.received, attacked.raw) >= attacked.sent,
        f"a message took {attacked.messages.longest_ms:.0f} ms": attacked.messages.longest_ms < LONGEST_S * 1000,
        f"the loop took {attacked.loop.longest_ms:.0f} ms": attacked.loop.longest_ms < LONGEST_S * 1000,
        f"memory grew by {grown_kb // 1024} MB; at most {most_kb // 1024}": grown_kb <= most_kb,
        "descriptors were not released": is_released,
        f"the loop's lag p99 grew {ratio:.2f} times; at most {GOAL:g}": ratio <= GOAL or duration < FULL_S,
    }
    return [words for words, is_held in held.items() if not is_held]


def growth(quiet: Lags, attacked: Lags) -> float:
    """Return the p99 under attack as a multiple of that without."""
    return attacked.p99_ms / quiet.p99_ms


def arguments() -> argparse.Namespace:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(prog="python -m tests.attack", description=__doc__.splitlines()[0])
    parser.add_argument("--duration", type=float, default=60.0, help="of each of the two phases, s")
    parser.add_argument("--captain", default=BINARY if os.path.exists(BINARY) else SOURCE)
    parser.add_argument("--only", nargs="+", choices=tuple(ATTACKS), default=tuple(ATTACKS))
    return parser.parse_args()


def show(quiet: Phase, attacked: Phase) -> None:
    print(
        f"{'':10}{'loop p99, longest, ms':>24}{'message p99, longest':>24}{'sent':>8}{'received':>10}{'raw':>8}{'MB':>8}"
    )
    for name, one in (("quiet", quiet), ("attacked", attacked)):
        lags = (one.loop.p99_ms, one.loop.longest_ms, one.messages.p99_ms, one.messages.longest_ms)
        figures = "".join(f"{lag:12.2f}" for lag in lags)
        print(f"{name:10}{figures}{one.sent:8}{one.received:10}{one.raw:8}{one.memory_kb / 1024:8.1f}")
    loop, message = growth(quiet.loop, attacked.loop), growth(quiet.messages, attacked.messages)
    print(f"lag p99 attacked / quiet: of the loop {loop:.2f} (goal: at most {GOAL:g}), of a message {message:.2f}")


def count_descriptors(station: Station) -> int:
    return len(list(Path(f"/proc/{station.process.pid}/fd").iterdir()))


def until(holds: Callable[[], bool]) -> bool:
    """Whether something comes to hold."""
    end = time.monotonic() + PATIENCE_S
    while not holds():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


if __name__ == "__main__":
    sys.exit(main())
