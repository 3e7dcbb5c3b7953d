"""Requirements on the guest's kernel."""

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from board.machine import REAL
from board.runtime.loop import Loop
from board.uevent import Uevent, Uevents

LOOK_S = 0.05  # sysfs does not tell of everything: it is looked at again after this time
CONFIGFS = Path("/sys/kernel/config")

Seen = Callable[[str], None]  # told what a check saw


def load(module: str, **parameters: object) -> None:
    """Load a module; one that is there already stays."""
    run("modprobe", module, *(f"{name}={value}" for name, value in parameters.items()))


def run(*command: str) -> str:
    """What a program prints; one that fails fails the check, with what it said."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}: {done.stderr.strip() or done.stdout.strip()}"
    return done.stdout


@contextmanager
def started(*command: str) -> Iterator[None]:
    """A program that goes on meanwhile."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()


def children() -> set[int]:
    """Processes that this one has started and not waited for."""
    return set(map(int, Path("/proc/thread-self/children").read_text().split()))


def until(loop: Loop, is_so: Callable[[], object], within_s: float = 60.0) -> float:
    """Turn a loop until something is so; returns the seconds that it took. Fails when it is not in time."""
    began = loop.clock()
    end = loop.after(within_s, lambda: None)
    while not is_so():
        assert end.is_pending, f"not so within {within_s} s"
        look = loop.after(LOOK_S, lambda: None)
        loop.turn()
        look.cancel()
    end.cancel()
    return loop.clock() - began


class Hotplug:
    """Listens to the kernel's uevents: what has come and gone, as `add tty`, in its order."""

    def __init__(self, loop: Loop) -> None:
        self.told: list[str] = []
        self._uevents = Uevents(loop, REAL, self._tell)

    def close(self) -> None:
        self._uevents.close()

    def _tell(self, event: Uevent | None) -> None:
        self.told.append(f"{event.action} {event.subsystem}" if event else "missed")
