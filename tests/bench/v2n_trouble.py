"""Troubled brokers for the V2N benchmark: one for each kind of trouble."""

import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from firmware.lab.certificates import Pair
from tests.bench import programs
from tests.bench.subject import START_S, Station
from tests.broker.bad import FullBacklog, Listener, silent
from tests.broker.certificates import Authority
from tests.broker.mosquitto import Mosquitto
from tests.broker.names import SilentNames
from tests.broker.proxy import Proxy
from tests.system.ports import Ports

DELAY_S = 0.5
CLOSE_EVERY_S = 1.0
BURST_RATE = 5000
BETWEEN_S = 0.02
SYN_SENT = "02"  # state of /proc/net/tcp

INTERFACE = """
[interfaces.v2n]
driver = "mqtt"
url = "mqtts://{host}:{port}"
host = "bench"
client_id = "bench"
ca = "{authority.certificate}"
certificate = "{client.certificate}"
key = "{client.key}"
"""


class Ground(NamedTuple):
    """What all troubles stand on: a healthy broker, and certificates."""

    folder: Path
    authority: Authority
    client: Pair
    broker: Mosquitto

    def interface(self, port: int, host: str = "localhost", more: str = "") -> str:
        """For the station's configuration."""
        return INTERFACE.format(host=host, port=port, authority=self.authority, client=self.client) + more


class Trouble(NamedTuple):
    """A broker or what passes for one.

    interface   for the station's configuration.
    is_reached  asked until the station is in it.
    begin       what makes it worse once the station is there.
    command     of the station, made of its own.
    """

    interface: str
    is_reached: Callable[[Station], bool]
    begin: Callable[[], None] = lambda: None
    command: Callable[[Sequence[str]], Sequence[str]] = lambda own: own


@contextmanager
def ground() -> Iterator[Ground]:
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        ports = Ports()
        stack.callback(ports.release)
        folder = Path(name)
        authority = Authority(folder)
        broker = stack.enter_context(Mosquitto(folder, ports, authority))
        yield Ground(folder, authority, authority.client("bench"), broker)


class Troubled(Station):
    """A station in a trouble."""

    def __init__(self, captain: str, trouble: Trouble) -> None:
        super().__init__(captain=captain, more=trouble.interface)
        self.name = "station with V2N"
        self._trouble = trouble

    def command(self) -> Sequence[str]:
        return self._trouble.command(super().command())

    def _wait(self) -> None:
        super()._wait()
        end = time.monotonic() + START_S
        while not self._trouble.is_reached(self):
            if time.monotonic() > end:
                state = self.status()["interfaces"]["v2n"]
                raise RuntimeError(f"v2n is {state['state']}: {state['why']}")
            time.sleep(BETWEEN_S)
        self._trouble.begin()


def is_up(station: Station) -> bool:
    try:
        return bool(station.status()["interfaces"]["v2n"]["state"] == "up")
    except (FileNotFoundError, ConnectionRefusedError):
        return False  # its control socket comes after those of the users


@contextmanager
def healthy(ground: Ground) -> Iterator[Trouble]:
    yield Trouble(ground.interface(ground.broker.port), is_up)


@contextmanager
def delayed(ground: Ground) -> Iterator[Trouble]:
    with Proxy(ground.broker.port, delay_s=DELAY_S) as proxy:
        yield Trouble(ground.interface(proxy.port), is_up)


@contextmanager
def full_backlog(ground: Ground) -> Iterator[Trouble]:
    with FullBacklog() as listener:
        before = _unanswered(listener.port)
        yield Trouble(ground.interface(listener.port), lambda _: _unanswered(listener.port) > before)


@contextmanager
def mute_names(ground: Ground) -> Iterator[Trouble]:
    with SilentNames(ground.folder) as names:
        interface = ground.interface(ground.broker.port, host="broker.example")
        yield Trouble(interface, lambda _: names.is_asked(), command=names.asked_by)


@contextmanager
def stalled_handshake(ground: Ground) -> Iterator[Trouble]:
    with Listener(silent) as listener:
        yield Trouble(ground.interface(listener.port), lambda _: listener.accepted > 0)


@contextmanager
def closing(ground: Ground) -> Iterator[Trouble]:
    over = threading.Event()

    def cut() -> None:
        while not over.wait(CLOSE_EVERY_S):
            proxy.cut()

    with Proxy(ground.broker.port) as proxy:
        thread = threading.Thread(target=cut)
        try:
            yield Trouble(ground.interface(proxy.port), is_up, thread.start)
        finally:
            over.set()
            thread.join()


@contextmanager
def reading_no_more(ground: Ground) -> Iterator[Trouble]:
    with Proxy(ground.broker.port) as proxy:
        yield Trouble(ground.interface(proxy.port), is_up, proxy.stall)


@contextmanager
def bursts(ground: Ground) -> Iterator[Trouble]:
    words = ("burst-broker", ground.broker.plain_port, 0, BURST_RATE, 0)
    process = end(*words)
    try:
        yield Trouble(ground.interface(ground.broker.port), is_up, lambda: go(process))
    finally:
        process.kill()
        process.communicate()


TROUBLES = {
    "healthy broker, QoS 1": healthy,
    "proxy that delays by 500 ms": delayed,
    "full backlog": full_backlog,
    "DNS that hangs": mute_names,
    "TLS handshake that stalls": stalled_handshake,
    "closed every second": closing,
    "stops reading": reading_no_more,
    "bursts of 5000/s from the broker": bursts,
}


def end(*words: object) -> "subprocess.Popen[str]":
    """A far end (v2n_ends.py) that has said it is ready."""
    command = [sys.executable, "-m", "tests.bench.v2n_ends", *map(str, words)]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, cwd=programs.ROOT, stdin=pipe, stdout=pipe, text=True)
    assert process.stdout is not None
    if process.stdout.readline() != "ready\n":
        process.kill()
        process.communicate()
        raise RuntimeError(f"{command} is not ready")
    return process


def go(process: "subprocess.Popen[str]") -> None:
    """To an end that sends: begin; and the second time: end."""
    assert process.stdin is not None
    process.stdin.write("\n")
    process.stdin.flush()


def _unanswered(port: int) -> int:
    """SYNs to a port that wait for an answer."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return sum(row[3] == SYN_SENT and int(row[2].split(":")[1], 16) == port for row in rows)
