"""Simulated receiver in a process of its own. Prints the path of its port.

usage: python -m tests.bench.time_receiver     until its standard input ends
"""

import select
import sys
import time

from board.runtime.loop import Loop
from board.time.scales import GPS_EPOCH, GPS_LEAPS, LEAPS
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver


class Input:
    """Ends the loop when nobody is at the other end any more."""

    def __init__(self, loop: Loop) -> None:
        self._loop = loop

    def fileno(self) -> int:
        return sys.stdin.fileno()

    def ready(self, events: int) -> None:
        if events & select.EPOLLHUP or not sys.stdin.buffer.raw.read(1):
            self._loop.stop()


def main() -> int:
    loop = Loop()
    now = time.time()
    gps_s = int(now) - GPS_EPOCH + GPS_LEAPS + len(LEAPS)
    habits = Habits(gps_s=gps_s, fraction_s=now % 1.0, port="uart1", boot_s=0.1, fix_s=0.3, leap_s=0.3)
    receiver = Receiver(loop, habits)
    receiver.power(True)
    print(receiver.path, flush=True)
    loop.add(Input(loop))
    loop.run()
    receiver.unplug()
    return 0


if __name__ == "__main__":
    sys.exit(main())
