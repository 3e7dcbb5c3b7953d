"""The bench: guests, what gives them pulses, and the truth, on one loop whose clock is the truth."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from board.runtime.child import die_with_parent
from board.runtime.loop import Loop
from tests.proof.clock.machine import Guest, LateError
from tests.proof.clock.truth import S, Span, Truth

LEAD_NS = 300_000_000  # the pulser is told of a pulse so long before its moment


class Struck(NamedTuple):
    """A pulse that was given: the ITS second that it begins, and on the host's clock when QEMU raised the line."""

    its_s: int
    at_ns: Span


class Pulser:
    """One pulse each true second, to all guests; struck is called with what each got, in the order of the guests."""

    def __init__(self, loop: Loop, truth: Truth, monitors: list[Path], struck: Callable[[list[Struck]], None]) -> None:
        self.is_on = True  # False: the antenna is off
        self._loop = loop
        self._truth = truth
        self._struck = struck
        self._due: dict[int, int] = {}
        self._heard = b""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.proof.clock.pulser", *map(str, monitors)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            preexec_fn=die_with_parent(signal.SIGKILL),  # noqa: PLW1509 - no other thread runs here
        )
        loop.add(self)
        self._plan()

    def fileno(self) -> int:
        assert self._process.stdout is not None
        return self._process.stdout.fileno()

    def ready(self, events: int) -> None:
        *lines, self._heard = (self._heard + os.read(self.fileno(), 65_536)).split(b"\n")
        for line in lines:
            moment, *spans = json.loads(line)
            its_s = self._due.pop(moment)
            self._struck([Struck(its_s, Span(*span)) for span in spans])

    def close(self) -> None:
        self._loop.remove(self)
        self._process.kill()
        self._process.communicate()

    def _plan(self) -> None:
        its_s = int(self._truth.clock()) + self._truth.its_s + 1
        moment = self._truth.host_ns(its_s * S)
        if self.is_on and moment not in self._due:
            self._due[moment] = its_s
            assert self._process.stdin is not None
            self._process.stdin.write(b"%d\n" % moment)
            self._process.stdin.flush()
        self._loop.after(its_s + 1 - self._truth.its_s - LEAD_NS / S - self._truth.clock(), self._plan)


class Bench:
    """A loop on the clock of the truth, and a folder for sockets."""

    def __init__(self, truth: Truth, folder: Path) -> None:
        self.truth = truth
        self.folder = folder
        self.loop = Loop(truth.clock)
        self.guests: list[Guest] = []
        self.pulser: Pulser | None = None

    def until(self, is_done: Callable[[], object], limit_s: float, what: str) -> None:
        """Turn until something is so. Raises LateError when it is not within so many true seconds."""
        end = self.loop.after(limit_s, lambda: None)
        while not is_done():
            if not end.is_pending:
                raise LateError(f"{what}: not within {limit_s:.0f} s")
            for guest in self.guests:
                if guest.is_gone:
                    raise LateError(f"{what}: {guest.name} is off; its console:\n{guest.last_words()}")
            self.loop.turn()
        end.cancel()

    def boot(self, guest: Guest) -> None:
        """Wait for one, and close the bench with it."""
        self.guests.append(guest)

    def wait_for_guests(self) -> None:
        limit_s = max(guest.boot_s for guest in self.guests)
        self.until(lambda: all(guest.is_up for guest in self.guests), limit_s, "the guests' agents")

    def turn_for(self, seconds: float) -> None:
        end = self.loop.after(seconds, lambda: None)
        self.until(lambda: not end.is_pending, seconds + 60, "the end of a pause")

    def close(self) -> None:
        if self.pulser is not None:
            self.pulser.close()
        for guest in self.guests:
            guest.kill()
        self.loop.close()


@contextmanager
def bench(truth: Truth) -> Iterator[Bench]:
    """A bench, whose guests are without power at its end, whatever that is."""
    folder = Path(tempfile.mkdtemp(prefix="clock-"))
    made = Bench(truth, folder)
    try:
        yield made
    finally:
        made.close()
        shutil.rmtree(folder)
