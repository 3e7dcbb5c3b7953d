"""A program of the system as a child: run on the loop, its output bounded, its time as well."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence

from board.child import die_with_parent
from board.errors import BlockedError, InterfaceError
from board.exit import Exit
from board.loop import Loop, Timer

MAX_OUTPUT = 64 * 1024  # octets that are kept; what is said beyond is read and thrown away
BATCH = 4096
GRACE_S = 2.0  # from SIGTERM to SIGKILL

# What brings a tool that is missing, as Debian calls it.
PACKAGES = {"qmicli": "libqmi-utils", "mbimcli": "libmbim-utils", "ip": "iproute2", "chronyc": "chrony"}


class Tool:
    """A program that was started.

    done   is called once: with its exit status and output, or with None and the output so far when `keep` was found
           in it. Kept, it goes on, and ended() tells of its end.
    quick  it ends by itself within moments and may outlive the station: it is started by vfork, which holds the loop
           for 0.2 ms, where a fork that asks for a signal at the station's end holds it for 6.
    """

    def __init__(
        self,
        loop: Loop,
        argv: Sequence[str],
        limit_s: float,
        done: Callable[[int | None, str], None],
        *,
        keep: str = "",
        ended: Callable[[], None] = lambda: None,
        quick: bool = False,
    ) -> None:
        """Start it. Raises BlockedError where it is not installed, InterfaceError where no process can be made."""
        self.name = argv[0]
        self._loop = loop
        self._keep = re.compile(keep) if keep else None
        self._done: Callable[[int | None, str], None] | None = done
        self._ended: Callable[[], None] | None = ended
        self._output = bytearray()
        path = shutil.which(argv[0])
        if path is None:
            package = PACKAGES.get(argv[0], argv[0])
            raise BlockedError(f"{argv[0]} is not installed", f"apt install {package}")
        try:
            # (1) Between fork and exec it makes one call of the C library, which is loaded. Another thread, that of
            # pps.device, holds no lock that this needs: it sits in an ioctl, and who forks has the interpreter's.
            self._child = subprocess.Popen(
                [path, *argv[1:]],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment(),
                preexec_fn=None if quick else die_with_parent(signal.SIGTERM),  # noqa: PLW1509 (1)
            )
            assert self._child.stdout is not None
            self._stdout = self._child.stdout
            self._exit = self._watched()
        except OSError as error:
            raise InterfaceError(f"{path}: {error.strerror}") from error
        os.set_blocking(self._stdout.fileno(), False)
        loop.add(self)
        loop.add(self._exit)
        self._timer: Timer | None = loop.after(limit_s, self.stop)

    def fileno(self) -> int:
        return self._stdout.fileno()

    def ready(self, events: int) -> None:
        if not self._read():
            self._loop.remove(self)

    def stop(self) -> None:
        """End it; idempotent."""
        if self._child.returncode is None:
            self._child.terminate()
            self._watch(self._loop.after(GRACE_S, self._child.kill))

    def leave(self) -> None:
        """stop(), and nobody is told."""
        self._done = self._ended = None
        self.stop()

    def _watched(self) -> Exit:
        try:
            return Exit(self._child, self._exited)
        except OSError:
            self._stdout.close()
            raise

    def _read(self) -> bool:
        """Take what it said; False at the end."""
        try:
            octets = os.read(self._stdout.fileno(), BATCH)
        except BlockingIOError:
            return True
        self._output += octets[: MAX_OUTPUT - len(self._output)]
        if self._keep is not None and self._keep.search(self._text()):
            self._keep = None
            self._watch(None)
            self._tell(None)
        return bool(octets)

    def _exited(self) -> None:
        for _ in range(MAX_OUTPUT // BATCH):
            if not self._read_again():
                break
        self._loop.remove(self)
        self._loop.remove(self._exit)
        self._stdout.close()
        self._exit.close()
        status = self._child.wait()  # is there: it has ended
        self._watch(None)
        self._tell(status)
        if self._ended is not None:
            self._ended()

    def _read_again(self) -> bool:
        before = len(self._output)
        return self._read() and len(self._output) > before

    def _tell(self, status: int | None) -> None:
        done, self._done = self._done, None
        if done is not None:
            done(status, self._text())

    def _text(self) -> str:
        return self._output.decode("utf-8", "replace")

    def _watch(self, timer: Timer | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = timer


def environment() -> dict[str, str] | None:
    """Of a program of the system: the libraries of a frozen station are not for it. None: our own."""
    if not getattr(sys, "frozen", False):
        return None
    # Its loader points there, and keeps what was said before (PyInstaller's manual, "LD_LIBRARY_PATH considerations").
    # By _PYI_* a captain that is started behind the program, such as in the console's shell, would take itself for a
    # worker of this one, whose libraries are found already.
    ours = ("LD_LIBRARY_PATH", "_PYI_")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    before = os.environ.get("LD_LIBRARY_PATH_ORIG", "")
    return environment | ({"LD_LIBRARY_PATH": before} if before else {})
