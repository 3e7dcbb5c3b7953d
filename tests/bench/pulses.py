"""Cost and latency of a pulse, from the kernel's call to the station.

Cost: a function in place of the kernel has the next edge as soon as the last was heard. A real kernel adds a sleep
and a wake-up of each thread; two of them, by pipes, are measured beside it.

Lateness: the kernel's stamp of a datagram (SO_TIMESTAMPNS) replaces that of an edge. Measured is the time from there
until the thread has read the clocks. With a loop that sleeps, and with one that only runs Python.
"""

import argparse
import errno
import os
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from tempfile import NamedTemporaryFile

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from pps.device import PulseDevice
from pps.ioctl import CANWAIT, CAPTURES, FDATA, KPARAMS, PPS_FETCH, PPS_GETCAP
from pps.pulse import Clocks, Pulse, read_clocks

SECOND_NS = 10**9

SO_TIMESTAMPNS = 35  # asm-generic/socket.h; its control message has the same number
SENDER = """
import random, socket, sys, time
chance = random.Random(6)
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
    for _ in range(int(sys.argv[2])):
        time.sleep(chance.uniform(0.03, 0.07))
        sender.sendto(b".", ("127.0.0.1", int(sys.argv[1])))
"""


class OverError(Exception):
    """There are no more edges."""


class Kernel:
    """A PPS device whose edges come from a function: it waits for one and returns its stamp, or raises OverError.

    thread_ns  processor time of the thread that asks, when it last began to wait.
    is_edge    whether its last answer was an edge.
    """

    def __init__(self, edge: Callable[[], int]) -> None:
        self.thread_ns = 0
        self.stamp_ns = 0
        self.is_edge = False
        self._sequence = 0
        self._edge = edge

    def __call__(self, device: int, number: int, octets: bytearray) -> None:
        if number == PPS_FETCH:
            self._fetch(octets)
        elif number == PPS_GETCAP:
            octets[:] = struct.pack("@i", CANWAIT | CAPTURES["assert"])
        else:
            octets[:] = KPARAMS.pack(1, CAPTURES["assert"], 0, 0, 0, 0, 0, 0)

    def _fetch(self, octets: bytearray) -> None:
        *_, wait_s, wait_ns, flags = FDATA.unpack(octets)
        self.is_edge = wait_s > 0
        if self.is_edge:
            self.thread_ns = time.thread_time_ns()
            try:
                self.stamp_ns = self._edge()
            except OverError as over:
                raise OSError(errno.ENODEV, "over") from over
            self._sequence += 1
        octets[:] = FDATA.pack(
            self._sequence, 0, *divmod(self.stamp_ns, SECOND_NS), 0, 0, 0, 0, 0, wait_s, wait_ns, flags
        )


class Above:
    """Calls at each pulse, and ends the loop after so many or at the end."""

    def __init__(self, loop: Loop, count: int, again: Callable[[], object]) -> None:
        self.left = count
        self._loop = loop
        self._again = again

    def pulse(self, pulse: Pulse) -> None:
        self.left -= 1
        if self.left:
            self._again()
        else:
            self._loop.stop()

    def missed(self, count: int) -> None:
        self.left -= count

    def failed(self, error: InterfaceError) -> None:
        self._loop.stop()


def run(loop: Loop, kernel: Kernel, above: Above, clocks: Callable[[], Clocks] = read_clocks) -> None:
    """Turn the loop with a device of this kernel until the end."""
    with NamedTemporaryFile(prefix="pps") as node:
        device = PulseDevice(loop, Path(node.name), above, ioctl=kernel, clocks=clocks)
        device.start()
        assert device._fetcher is not None
        device._fetcher._leaves.wait = lambda timeout=None: False  # type: ignore[method-assign]  # no rest: no storm
        loop.run()
        device.stop()


def cost(count: int) -> tuple[float, float]:
    """Microseconds of processor time per pulse: of the thread, and of the loop."""
    heard, left = threading.Semaphore(1), iter(range(count + 1))

    def edge() -> int:
        heard.acquire()
        if next(left, count) == count:
            raise OverError
        return time.clock_gettime_ns(time.CLOCK_REALTIME)

    with closing(Loop()) as loop:
        kernel = Kernel(edge)
        began_ns = time.thread_time_ns()
        run(loop, kernel, Above(loop, count, heard.release))
        loop_ns = time.thread_time_ns() - began_ns
        heard.release()
    return kernel.thread_ns / count / 1000, loop_ns / count / 1000


def lateness(count: int, is_busy: bool) -> list[float]:
    """Microseconds from the kernel's stamp to the thread's clocks, of each pulse, in order of size."""
    late_us: list[float] = []

    def clocks() -> Clocks:
        now = read_clocks()
        if kernel.is_edge:
            late_us.append((now.system_ns - kernel.stamp_ns) / 1000)
        return now

    def edge() -> int:
        try:
            _, (control,), _, _ = receiver.recvmsg(1, 64)
        except TimeoutError:
            raise OverError from None
        stamp_s, stamp_ns = struct.unpack("@qq", control[2])
        return int(stamp_s * SECOND_NS + stamp_ns)

    def busy() -> None:
        sum(range(2000))
        loop.soon(busy)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver, closing(Loop()) as loop:
        receiver.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(1.0)
        kernel = Kernel(edge)
        if is_busy:
            loop.soon(busy)
        command = [sys.executable, "-c", SENDER, str(receiver.getsockname()[1]), str(count)]
        with subprocess.Popen(command):
            run(loop, kernel, Above(loop, count, lambda: None), clocks)
    return sorted(late_us)


def wake_ups(count: int) -> float:
    """Microseconds of both threads' processor time for one octet through a pipe there and back: two wake-ups."""
    here, there = os.pipe(), os.pipe()

    def answer() -> None:
        for _ in range(count):
            os.write(there[1], os.read(here[0], 1))

    thread = threading.Thread(target=answer)
    began_ns = time.process_time_ns()
    thread.start()
    for _ in range(count):
        os.write(here[1], b".")
        os.read(there[0], 1)
    thread.join()
    for descriptor in (*here, *there):
        os.close(descriptor)
    return (time.process_time_ns() - began_ns) / count / 1000


def reading(count: int) -> float:
    """Microseconds of read_clocks()."""
    began_ns = time.thread_time_ns()
    for _ in range(count):
        read_clocks()
    return (time.thread_time_ns() - began_ns) / count / 1000


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.pulses", description=__doc__)
    parser.add_argument("--count", type=int, default=20_000, help="pulses of a round (default 20000)")
    parser.add_argument("--rounds", type=int, default=5, help="the best of so many is shown (default 5)")
    parser.add_argument("--late", type=int, default=300, help="pulses whose lateness is measured (default 300)")
    arguments = parser.parse_args()
    rounds = [cost(arguments.count) for _ in range(arguments.rounds)]
    thread_us, loop_us = (min(figures) for figures in zip(*rounds, strict=True))
    print(f"a pulse, processor time: {thread_us:5.1f} us in the thread, {loop_us:5.1f} us in the loop;", end=" ")
    print(f"once a second {(thread_us + loop_us) / 1e4:.4f} % of a core")
    print(f"two wake-ups by pipes:   {min(wake_ups(arguments.count) for _ in range(arguments.rounds)):5.1f} us")
    print(f"the clocks, once:        {min(reading(arguments.count) for _ in range(arguments.rounds)):5.1f} us")
    for is_busy in (False, True):
        late_us = lateness(arguments.late, is_busy)
        median, most = statistics.median(late_us), late_us[len(late_us) * 99 // 100]
        print(f"taken after the stamp:   {median:5.0f} us median, {most:.0f} us in 99 of 100,", end=" ")
        print(f"beside a loop that {'runs Python all the time' if is_busy else 'sleeps'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
