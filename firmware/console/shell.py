"""A shell on the console's terminal: a child with a process group of its own, which has the terminal until it ends."""

import fcntl
import os
import signal
import subprocess
import termios
from collections.abc import Callable, Sequence
from contextlib import suppress

from board.child import die_with_parent
from board.errors import InterfaceError
from board.exit import Exit
from board.loop import Loop, Timer
from board.tool import environment

LOOK_S = 1.0  # between two looks at whether it was stopped


class Shell:
    """Runs on a terminal that is lent to it; ended is told its exit status.

    It is hung up when the console ends, however that does, and goes on where it was stopped: nobody else could have it
    do so. Raises InterfaceError when it cannot be started.
    """

    def __init__(self, loop: Loop, argv: Sequence[str], terminal: int, ended: Callable[[int], None]) -> None:
        self._loop = loop
        self._terminal = terminal
        self._ended = ended
        self._group = _foreground(terminal)
        # Whoever is in the background and sets the foreground would be stopped.
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
            raise InterfaceError(f"{argv[0]}: {why}", "another one is named with --shell") from error
        loop.add(self._exit)
        self._look_again: Timer = loop.after(LOOK_S, self._look)

    def hang_up(self) -> None:
        """Tell it that its terminal is gone."""
        self._child.send_signal(signal.SIGHUP)

    def _look(self) -> None:
        """Ctrl-Z stops what a shell has become by `exec`, and a shell may stop itself."""
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
        """The terminal is the console's again, though a job of the shell may have been in its foreground."""
        if self._group is not None:
            with suppress(OSError):  # it has hung up
                os.tcsetpgrp(self._terminal, self._group)
        signal.signal(signal.SIGTTOU, self._background)


def _foreground(terminal: int) -> int | None:
    """The process group in front; None where the terminal does not control this process's session."""
    try:
        return os.tcgetpgrp(terminal)
    except OSError:
        return None


def _ours(terminal: int, is_controlling: bool) -> Callable[[], None]:
    """What the child does before it becomes the shell."""
    die = die_with_parent(signal.SIGHUP)

    def take() -> None:
        die()
        if is_controlling:
            os.setpgid(0, 0)
            os.tcsetpgrp(terminal, os.getpid())
        else:
            os.setsid()
            fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
        for number in range(signal.SIGHUP, signal.SIGSYS + 1):  # whatever started the station ignored
            if number not in (signal.SIGKILL, signal.SIGSTOP):
                signal.signal(number, signal.SIG_DFL)

    return take
