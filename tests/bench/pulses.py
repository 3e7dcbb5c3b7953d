"""python -m tests.bench.pulses: what a pulse costs from the kernel's call to whoever hears of it, in processor time.

The kernel is played by a function that returns at once with the next edge, a pulse per call, as fast as the loop takes
them; so no pulse waits, and neither does the thread. What a real one adds is one sleep and one wake-up of the thread
in each second, and the time-outs where there are no pulses: both are measured beside it, with a pipe's wake-up.
"""

import argparse
import os
import struct
import sys
import threading
import time
from pathlib import Path
from tempfile import NamedTemporaryFile

from board.errors import InterfaceError
from board.loop import Loop
from pps.device import Device
from pps.ioctl import CANWAIT, CAPTURES, FDATA, KPARAMS, PPS_FETCH, PPS_GETCAP
from pps.pulse import Pulse, read_clocks

SECOND_NS = 10**9


class Kernel:
    """Edges without end, two calls each: one that has it, one that finds nothing new. It counts the thread's time."""

    def __init__(self, loop: Loop) -> None:
        self.took = threading.Semaphore(0)
        self.thread_ns = 0
        self._sequence = 0
        self._is_over = False

    def __call__(self, device: int, number: int, octets: bytearray) -> None:
        if number == PPS_FETCH:
            self._fetch(octets)
        elif number == PPS_GETCAP:
            octets[:] = struct.pack("@i", CANWAIT | CAPTURES["assert"])
        else:
            octets[:] = KPARAMS.pack(1, CAPTURES["assert"], 0, 0, 0, 0, 0, 0)

    def end(self) -> None:
        self._is_over = True
        self.took.release()

    def _fetch(self, octets: bytearray) -> None:
        *_, wait_s, wait_ns, flags = FDATA.unpack(octets)
        if wait_s:
            self.thread_ns = time.thread_time_ns()
            self.took.acquire()
            if self._is_over:
                raise OSError(19, "over")
            self._sequence += 1
        stamp_ns = time.clock_gettime_ns(time.CLOCK_REALTIME)
        octets[:] = FDATA.pack(self._sequence, 0, *divmod(stamp_ns, SECOND_NS), 0, 0, 0, 0, 0, wait_s, wait_ns, flags)


class Above:
    """Lets the next pulse come when it has heard of one, and ends the loop after so many."""

    def __init__(self, loop: Loop, kernel: Kernel, count: int) -> None:
        self.left = count
        self._loop = loop
        self._kernel = kernel

    def pulse(self, pulse: Pulse) -> None:
        self.left -= 1
        if self.left:
            self._kernel.took.release()
        else:
            self._loop.stop()

    def missed(self, count: int) -> None:
        raise AssertionError(f"{count} missed")

    def failed(self, error: InterfaceError) -> None:
        raise error


def measured(count: int) -> tuple[float, float]:
    """Microseconds of processor time per pulse: of the thread, and of the loop."""
    loop = Loop()
    kernel = Kernel(loop)
    above = Above(loop, kernel, count)
    with NamedTemporaryFile(prefix="pps") as node:
        device = Device(loop, Path(node.name), above, ioctl=kernel)
        device.start()
        fetcher = device._fetcher
        assert fetcher is not None
        fetcher._leaves.wait = lambda timeout=None: False  # type: ignore[method-assign]  # no rest: it is no storm
        kernel.took.release()
        began_ns, thread_began_ns = time.thread_time_ns(), kernel.thread_ns
        loop.run()
        loop_ns = time.thread_time_ns() - began_ns
        thread_ns = kernel.thread_ns - thread_began_ns
        device.stop()
        kernel.end()
    loop.close()
    return thread_ns / count / 1000, loop_ns / count / 1000


def wake_up(count: int) -> float:
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


def clocks(count: int) -> float:
    """Microseconds of read_clocks()."""
    began_ns = time.thread_time_ns()
    for _ in range(count):
        read_clocks()
    return (time.thread_time_ns() - began_ns) / count / 1000


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.pulses", description=__doc__)
    parser.add_argument("--count", type=int, default=20_000, help="pulses (default 20000)")
    parser.add_argument("--rounds", type=int, default=5, help="the best of so many is shown (default 5)")
    arguments = parser.parse_args()
    rounds = [measured(arguments.count) for _ in range(arguments.rounds)]
    thread_us, loop_us = (min(figures) for figures in zip(*rounds, strict=True))
    print(f"a pulse, processor time:  thread {thread_us:6.1f} us   loop {loop_us:6.1f} us")
    print(f"two wake-ups by pipes:           {min(wake_up(arguments.count) for _ in range(arguments.rounds)):6.1f} us")
    print(f"the clocks, once:                {min(clocks(arguments.count) for _ in range(arguments.rounds)):6.2f} us")
    print(f"at one pulse in a second: {(thread_us + loop_us) / 1e4:.4f} % of a core")
    return 0


if __name__ == "__main__":
    sys.exit(main())
