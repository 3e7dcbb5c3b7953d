"""A program beside the bench: it gives guests their pulses, each at its moment.

    python -m tests.clock.pulser QMP_SOCKET...

Takes lines with a moment of CLOCK_MONOTONIC in ns; pulses the line of every guest then, and answers with a line of
JSON: [moment, [before, after], ...], between which QEMU did so, a pair for each guest.
"""

import json
import os
import socket
import sys
import time
from contextlib import suppress
from typing import IO

from tests.clock.truth import S, host_ns

SPIN_NS = 2_000_000  # before the moment, in which it does not sleep


class Line:
    """The power key of a guest, which is the line of its pulse: by QMP."""

    def __init__(self, path: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(path)
        self._answers: IO[bytes] = self._socket.makefile("rb")
        self._answers.readline()  # its greeting
        self._execute(b"qmp_capabilities")

    def pulse(self) -> tuple[int, int]:
        before = host_ns()
        self._execute(b"system_powerdown")
        return before, host_ns()

    def _execute(self, command: bytes) -> None:
        self._socket.sendall(b'{"execute": "%s"}\n' % command)
        while "return" not in json.loads(self._answers.readline()):
            pass  # an event


def main() -> None:
    with suppress(PermissionError):  # then it is as late as this machine is busy, and says so
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    lines = [Line(path) for path in sys.argv[1:]]
    for word in sys.stdin:
        moment = int(word)
        time.sleep(max(0, moment - host_ns() - SPIN_NS) / S)
        while host_ns() < moment:
            pass
        print(json.dumps([moment, *(line.pulse() for line in lines)]), flush=True)


if __name__ == "__main__":
    main()
