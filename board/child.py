"""One child process of the same program, and the parent's end of the socket between them."""

import os
import signal
import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from board.exit import Exit
from board.loop import READ, WRITE, Loop

MAX_MESSAGE = 65536  # octets; a SEQPACKET socket refuses what exceeds its buffer, so this is refused first
SEND_BUFFER = 4 * MAX_MESSAGE  # octets, asked for: at least one message fits whatever the system's default is
BATCH = 32  # messages read or written in one call of ready(): other sources have their turn in between
QUEUE = 256  # messages that wait for a child which does not read
LAST = 4096  # messages that an ended child can have left in its socket: far fewer fit

HELLO = b"hello"  # the child's first message: it runs
START_S = 25.0  # a frozen program on a slow card needs 2 s, on a busy emulated processor 10
GRACE_S = 0.5  # to leave after its socket was closed, before it is killed
SILENCE_CHECKS = 5  # in a row that find nothing said: a pause of ours is one, however long it was
KILL_S = 0.5  # for SIGKILL to act: milliseconds, unless a device holds the process inside the kernel

PR_SET_PDEATHSIG = 1  # prctl(2)


class Parent(Protocol):
    """What a child tells of itself."""

    def up(self, child: "Child", pid: int) -> None:
        """It runs: send() takes messages."""

    def message(self, octets: bytes) -> None: ...

    def writable(self) -> None:
        """Half of a full queue has left."""

    def ended(self, child: "Child", why: str) -> None:
        """The process is gone and reaped."""


class Child:
    """A process that runs worker.child() and is started at once. Raises OSError where that is impossible.

    program    the command, to which `--worker NAME FD` is added.
    silence_s  it is killed when it runs and has said nothing for so long; 0 where it may be silent for ever.
    lost       messages that still waited when it ended.
    longest    the queue has been.
    """

    def __init__(self, loop: Loop, parent: Parent, program: Sequence[str], name: str, silence_s: float = 0.0) -> None:
        # The signal of PDEATHSIG comes when the *thread* that started the child ends.
        assert threading.current_thread() is threading.main_thread()
        self.loop = loop
        self.is_up = False
        self.queue: deque[bytes] = deque()
        self.lost = self.longest = 0
        self._parent = parent
        self._silence_s = silence_s
        self._has_spoken = True
        self._silent_checks = 0
        self._is_left = False
        self._was_full = False
        self._reason = "ended"
        self._channel, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with far:
            for end in (self._channel, far):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            try:
                self._process = _run([*program, "--worker", name, str(far.fileno())], far.fileno())
                self._exit = Exit(self._process, self.exited)
            except OSError:
                self._channel.close()
                raise
        self._channel.setblocking(False)
        self._deadline = loop.after(START_S, lambda: self._kill(f"did not run within {START_S:.0f} s"))
        loop.add(self)
        loop.add(self._exit)

    def fileno(self) -> int:
        return self._channel.fileno()

    def ready(self, events: int) -> None:
        if events & WRITE:
            self._flush()
        if events & ~WRITE and not self._read(BATCH):
            # It has closed its end and is about to leave; _exit tells when it has.
            self.is_up = False
            self.loop.remove(self)
            self._deadline.cancel()
            self._deadline = self.loop.after(GRACE_S, lambda: self._kill("closed its socket and stayed"))

    def send(self, message: bytes) -> bool:
        """Write or queue a message; False when it does not run or its queue is full."""
        if not self.is_up:
            return False
        if not self.queue:
            try:
                self._channel.send(message)
            except BlockingIOError:
                self.loop.want(self, READ | WRITE)
            except OSError:
                return False  # it has just ended: the next event tells
            else:
                return True
        if len(self.queue) >= QUEUE:
            self._was_full = True
            return False
        self.queue.append(message)
        self.longest = max(self.longest, len(self.queue))
        return True

    def leave(self) -> None:
        """Close its socket, which tells it to end; kill it GRACE_S later. Of what it says no more is heard."""
        self._is_left = True
        self._close()
        self._deadline = self.loop.after(GRACE_S, lambda: self._kill("was stopped and stayed"))

    def finish(self, within: float) -> None:
        """leave(), and wait here for its end, so many seconds at most before it is killed."""
        self.leave()
        if not self._exit.comes(within):
            self._process.kill()
            self._exit.comes(KILL_S)
        self.exited()

    def exited(self) -> None:
        """The process is gone: pass on what it left, reap it, tell the parent."""
        self._read(LAST)
        self._close()
        self._deadline.cancel()
        self.loop.remove(self._exit)
        self._exit.close()
        status = _status(self._process.poll())
        self._parent.ended(self, f"process {self._process.pid} {self._reason}, {status}")

    def _read(self, most: int) -> bool:
        """Pass on so many messages at most; False when there will be no more."""
        for _ in range(most):
            if self._is_left:  # because of the last message perhaps
                return True
            try:
                message = self._channel.recv(MAX_MESSAGE + 1)
            except BlockingIOError:
                return True
            except ConnectionResetError:
                continue  # it ended with messages of ours unread; its own come after this error
            if not message:
                return False
            self._take(message)
        return True

    def _take(self, message: bytes) -> None:
        self._has_spoken = True
        if len(message) > MAX_MESSAGE:
            self._kill(f"sent a message of more than {MAX_MESSAGE} octets")
        elif self.is_up:
            self._parent.message(message)
        elif message == HELLO:
            self._deadline.cancel()
            self.is_up = True
            self._listen()
            self._parent.up(self, self._process.pid)
        else:
            self._kill("is not this program: its first message is another")

    def _listen(self) -> None:
        """Look now and then whether it has said something."""
        self._silent_checks = 0 if self._has_spoken else self._silent_checks + 1
        self._has_spoken = False
        if self._silent_checks >= SILENCE_CHECKS:
            self._kill(f"has said nothing for {self._silence_s:g} s")
        elif self._silence_s:
            self._deadline = self.loop.after(self._silence_s / SILENCE_CHECKS, self._listen)

    def _flush(self) -> None:
        try:
            for _ in range(min(BATCH, len(self.queue))):
                self._channel.send(self.queue[0])
                self.queue.popleft()
        except OSError:
            return  # full again, or ended: the next event tells
        if not self.queue:
            self.loop.want(self, READ)
        if self._was_full and len(self.queue) <= QUEUE // 2:
            self._was_full = False
            self._parent.writable()

    def _kill(self, reason: str) -> None:
        self._reason = reason
        self._process.kill()

    def _close(self) -> None:
        """Forget the socket and what waited for it; idempotent."""
        self.is_up = False
        self._deadline.cancel()
        self.lost += len(self.queue)
        self.queue.clear()
        if self._channel.fileno() >= 0:
            self.loop.remove(self)
            self._channel.close()


def program() -> list[str]:
    """The command that starts this program once more."""
    return [sys.executable] if getattr(sys, "frozen", False) else [sys.executable, "-P", "-m", "firmware"]


def die_with_parent(number: int) -> Callable[[], None]:
    """What a process calls to be sent a signal when the thread that started it ends, whatever ended that.

    Made apart from the call, so that a process which has just been forked need not load a library.
    """
    import ctypes  # costs 10 ms: a station never needs it

    prctl = ctypes.CDLL(None).prctl
    return lambda: prctl(PR_SET_PDEATHSIG, number, 0, 0, 0)


def _run(command: Sequence[str], descriptor: int) -> subprocess.Popen[bytes]:
    """A process that inherits one descriptor, and stderr for whatever it prints.

    It also inherits the environment: from the `_PYI_*` in it a program frozen into one file sees that all is
    unpacked already, and needs no second process in between.
    """
    path = os.pathsep.join(filter(None, (str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=2, pass_fds=[descriptor], env=environment)


def _status(code: int | None) -> str:
    if code is None or code >= 0:
        return f"status {code}"
    return signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
