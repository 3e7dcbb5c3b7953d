"""Shell on the console's terminal: a child with its own process group."""

import fcntl
import os
import signal
import subprocess
import termios
from collections.abc import Callable, Sequence
from contextlib import suppress

from board.runtime.child import die_with_parent
from board.runtime.errors import InterfaceError
from board.runtime.exit import Exit
from board.runtime.loop import Loop, Timer
from board.runtime.tool import environment

LOOK_S = 1.0  # interval of checks for a stopped shell


class Shell:
    """Shell that runs on a terminal lent to it; ended() receives its exit status.

    The shell is hung up when the console ends, however that ends. If it was stopped, it is continued, because no other
    program could do so. Raises InterfaceError if it cannot be started.
    """

    def __init__(self, loop: Loop, argv: Sequence[str], terminal: int, ended: Callable[[int], None]) -> None:
        self._loop = loop
        self._terminal = terminal
        self._ended = ended
        self._group = _foreground(terminal)
        # Without this, setting the foreground group from the background would stop this process.
        self._background = signal.signal(signal.SIGTTOU, signal.SIG_IGN)
        try:
            self._child = subprocess.Popen(
                argv,
                stdin=terminal,
                stdout=terminal,
                stderr=terminal,
                env=environment(),
                preexec_fn=_ours(terminal, self._group is not None),  # noqa: PLW1509 one thread of Python
            )
            self._exit = Exit(self._child, self._exited)
        except (OSError, subprocess.SubprocessError) as error:
            self._return()
            why = getattr(error, "strerror", None) or str(error)
            raise InterfaceError(f"{argv[0]}: {why}", "name another program with --shell") from error
        loop.add(self._exit)
        self._look_again: Timer = loop.after(LOOK_S, self._look)

    def hang_up(self) -> None:
        """Send SIGHUP, because the terminal is gone."""
        self._child.send_signal(signal.SIGHUP)

    def _look(self) -> None:
        """Continue the shell if it was stopped: by Ctrl-Z, if `exec` replaced the shell, or by itself."""
        if os.waitid(os.P_PID, self._child.pid, os.WSTOPPED | os.WNOHANG):
            os.killpg(self._child.pid, signal.SIGCONT)
        self._look_again = self._loop.after(LOOK_S, self._look)

    def _exited(self) -> None:
        self._look_again.cancel()
        self._loop.remove(self._exit)
        self._exit.close()
        status = self._child.wait()
        self._return()
        self._ended(status)

    def _return(self) -> None:
        """Make the console the foreground group again; a job of the shell may have been it."""
        if self._group is not None:
            with suppress(OSError):  # the terminal has hung up
                os.tcsetpgrp(self._terminal, self._group)
        signal.signal(signal.SIGTTOU, self._background)


def _foreground(terminal: int) -> int | None:
    """Return the foreground process group; None if the terminal does not control this process's session."""
    try:
        return os.tcgetpgrp(terminal)
    except OSError:
        return None


def _ours(terminal: int, is_controlling: bool) -> Callable[[], None]:
    """Return the function that prepares the child before it becomes the shell."""
    die = die_with_parent(signal.SIGHUP)

    def take() -> None:
        die()
        if is_controlling:
            os.setpgid(0, 0)
            os.tcsetpgrp(terminal, os.getpid())
        else:
            os.setsid()
            fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
        for number in range(signal.SIGHUP, signal.SIGSYS + 1):  # ignored signals would be inherited
            if number not in (signal.SIGKILL, signal.SIGSTOP):
                signal.signal(number, signal.SIG_DFL)

    return take
