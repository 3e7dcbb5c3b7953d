"""System program as a child process with bounded output and time."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence

from board.runtime.child import die_with_parent
from board.runtime.errors import BlockedError, InterfaceError
from board.runtime.exit import Exit
from board.runtime.loop import Loop, Timer

MAX_OUTPUT = 64 * 1024  # octets of output that are kept; more is read and discarded
BATCH = 4096
GRACE_S = 2.0  # from SIGTERM to SIGKILL

# Debian package of a tool, for the remedy if the tool is missing.
PACKAGES = {"qmicli": "libqmi-utils", "mbimcli": "libmbim-utils", "ip": "iproute2", "chronyc": "chrony"}


class Tool:
    """Started program, with a time limit.

    done   called once: with exit status and output, or with None and the output so far when the output matches
           `keep`. After a match, the program runs without a limit, and ended() reports its end.
    quick  for a program that ends by itself within moments and may outlive the station. It is started by vfork, which
           blocks the loop for 0.2 ms. Else a fork, which also requests a signal at the station's end, takes 6 ms.
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
        """Start the program. Raises BlockedError if it is not installed, InterfaceError if no process can be made."""
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
            # (1) Between fork and exec, the child makes one call of the C library, which is loaded already. The only
            # other thread, that of pps.device, holds no lock that this call needs. It waits in an ioctl, and the
            # forking thread holds the interpreter's lock.
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
        """Terminate the program; idempotent."""
        if self._child.returncode is None:
            self._child.terminate()
            self._watch(self._loop.after(GRACE_S, self._child.kill))

    def leave(self) -> None:
        """Terminate the program without calling done() or ended()."""
        self._done = self._ended = None
        self.stop()

    def _watched(self) -> Exit:
        try:
            return Exit(self._child, self._exited)
        except OSError:
            self._stdout.close()
            raise

    def _read(self) -> bool:
        """Read output; return False at its end."""
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
        status = self._child.wait()  # returns at once, because the process has ended
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
    """Return the environment for a system program, without the library paths of a frozen station; None: unchanged."""
    if not getattr(sys, "frozen", False):
        return None
    # PyInstaller's loader sets LD_LIBRARY_PATH to the station's libraries. It keeps the previous value in
    # LD_LIBRARY_PATH_ORIG. Source: PyInstaller's manual, "LD_LIBRARY_PATH considerations".
    # _PYI_* is removed for a captain that the program starts, such as in the console's shell. With it, that captain
    # would take itself for a worker of this process and use its unpacked libraries.
    ours = ("LD_LIBRARY_PATH", "_PYI_")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    before = os.environ.get("LD_LIBRARY_PATH_ORIG", "")
    return environment | ({"LD_LIBRARY_PATH": before} if before else {})
