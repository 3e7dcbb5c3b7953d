"""Pulser of guests: a program beside the bench, with exact times.

    python -m tests.proof.clock.pulser QMP_SOCKET...

Takes lines with a moment of CLOCK_MONOTONIC in ns, and pulses the line of every guest then. Answers with a line of
JSON: [moment, [before, after], ...], a pair for each guest. QEMU did it between the two.
"""

import json
import os
import socket
import sys
import time
from contextlib import suppress
from typing import IO

from tests.proof.clock.truth import S, host_ns

SPIN_NS = 2_000_000  # before the moment, in which it does not sleep


class Line:
    """The power key of a guest, which is the line of its pulse: by QMP."""

    def __init__(self, path: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(path)
        self._answers: IO[bytes] = self._socket.makefile("rb")
        self._answers.readline()  # its greeting
        self._ask(b"qmp_capabilities")
        self._answer()

    def ask(self) -> int:
        """For a pulse; returns when."""
        before = host_ns()
        self._ask(b"system_powerdown")
        return before

    def answer(self) -> int:
        """When it has been given."""
        self._answer()
        return host_ns()

    def _ask(self, command: bytes) -> None:
        self._socket.sendall(b'{"execute": "%s"}\n' % command)

    def _answer(self) -> None:
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
        asked = [line.ask() for line in lines]  # all of them first: no guest's pulse waits for another's
        answered = [line.answer() for line in lines]
        print(json.dumps([moment, *zip(asked, answered, strict=True)]), flush=True)


if __name__ == "__main__":
    main()
