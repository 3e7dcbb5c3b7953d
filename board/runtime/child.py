"""Child process of the same program, with its end of a socket pair."""

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

from board.runtime.exit import Exit
from board.runtime.loop import READ, WRITE, Loop

MAX_MESSAGE = 65536  # octets; checked here, because a SEQPACKET socket would refuse a message above its buffer's size
SEND_BUFFER = 4 * MAX_MESSAGE  # octets, requested so that one message fits whatever the system's default is
BATCH = 32  # most messages read or written in one call of ready(), so that other sources are served in between
QUEUE = 256  # most messages that wait while the child does not read
LAST = 4096  # bound for messages left in the socket of an ended child; far fewer fit into it

HELLO = b"hello"  # the child's first message: it has started
START_S = 25.0  # a frozen program starts in 2 s from a slow card, in 10 s on a busy emulated processor
GRACE_S = 0.5  # time to exit after its socket was closed, before it is killed
SILENCE_CHECKS = 5  # silent checks in a row before the child is killed; a pause of this process counts as one check
KILL_S = 0.5  # time for SIGKILL to act: milliseconds, unless a device blocks the process inside the kernel

PR_SET_PDEATHSIG = 1  # prctl(2)


class Parent(Protocol):
    """Calls that a child makes to its owner."""

    def up(self, child: "Child", pid: int) -> None:
        """Report that the child has started: send() takes messages."""

    def message(self, octets: bytes) -> None: ...

    def writable(self) -> None:
        """Report that a full queue is half empty again."""

    def ended(self, child: "Child", why: str) -> None:
        """Report that the process has ended and is reaped."""


class Child:
    """Child process that runs worker.child(); it is started at once. Raises OSError if it cannot be started.

    program    command line, to which `--worker NAME FD` is added.
    silence_s  the child is killed after it sent no message for this time; 0: never.
    lost       number of messages that were still queued when it ended.
    longest    greatest length of the queue.
    """

    def __init__(self, loop: Loop, parent: Parent, program: Sequence[str], name: str, silence_s: float = 0.0) -> None:
        # PDEATHSIG sends its signal when the *thread* that started the child ends, so this must be the main thread.
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
        self._deadline = loop.after(START_S, lambda: self._kill(f"did not start within {START_S:.0f} s"))
        loop.add(self)
        loop.add(self._exit)

    def fileno(self) -> int:
        return self._channel.fileno()

    def ready(self, events: int) -> None:
        if events & WRITE:
            self._flush()
        if events & ~WRITE and not self._read(BATCH):
            # The child closed its end and is about to exit; _exit reports when it has.
            self.is_up = False
            self.loop.remove(self)
            self._deadline.cancel()
            self._deadline = self.loop.after(GRACE_S, lambda: self._kill("closed its socket but did not exit in time"))

    def send(self, message: bytes) -> bool:
        """Send or queue a message; return False if the child does not run or the queue is full."""
        if not self.is_up:
            return False
        if not self.queue:
            try:
                self._channel.send(message)
            except BlockingIOError:
                self.loop.want(self, READ | WRITE)
            except OSError:
                return False  # the child has just ended: the next event reports it
            else:
                return True
        if len(self.queue) >= QUEUE:
            self._was_full = True
            return False
        self.queue.append(message)
        self.longest = max(self.longest, len(self.queue))
        return True

    def leave(self) -> None:
        """Close the socket, which ends the child; kill it after GRACE_S. Its further messages are discarded."""
        self._is_left = True
        self._close()
        self._deadline = self.loop.after(GRACE_S, lambda: self._kill("did not exit in time after its stop"))

    def finish(self, within: float) -> None:
        """Call leave(), then wait for the end; kill the child after `within` seconds."""
        self.leave()
        if not self._exit.comes(within):
            self._process.kill()
            self._exit.comes(KILL_S)
        self.exited()

    def exited(self) -> None:
        """Handle the end of the process: pass on its last messages, reap it, and tell the parent."""
        self._read(LAST)
        self._close()
        self._deadline.cancel()
        self.loop.remove(self._exit)
        self._exit.close()
        status = _status(self._process.poll())
        self._parent.ended(self, f"process {self._process.pid} {self._reason}, {status}")

    def _read(self, most: int) -> bool:
        """Pass on at most `most` messages; return False after the last one that the child will send."""
        for _ in range(most):
            if self._is_left:  # the parent may have called leave() while it handled the previous message
                return True
            try:
                message = self._channel.recv(MAX_MESSAGE + 1)
            except BlockingIOError:
                return True
            except ConnectionResetError:
                continue  # the child ended without reading all our messages; its own messages can still be read
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
            self._kill("is not this program: unexpected first message")

    def _listen(self) -> None:
        """Check periodically that the child has sent a message; kill it after SILENCE_CHECKS silent checks."""
        self._silent_checks = 0 if self._has_spoken else self._silent_checks + 1
        self._has_spoken = False
        if self._silent_checks >= SILENCE_CHECKS:
            self._kill(f"was silent for {self._silence_s:g} s")
        elif self._silence_s:
            self._deadline = self.loop.after(self._silence_s / SILENCE_CHECKS, self._listen)

    def _flush(self) -> None:
        try:
            for _ in range(min(BATCH, len(self.queue))):
                self._channel.send(self.queue[0])
                self.queue.popleft()
        except OSError:
            return  # the socket is full again, or the child ended: the next event reports it
        if not self.queue:
            self.loop.want(self, READ)
        if self._was_full and len(self.queue) <= QUEUE // 2:
            self._was_full = False
            self._parent.writable()

    def _kill(self, reason: str) -> None:
        self._reason = reason
        self._process.kill()

    def _close(self) -> None:
        """Close the socket and discard queued messages; idempotent."""
        self.is_up = False
        self._deadline.cancel()
        self.lost += len(self.queue)
        self.queue.clear()
        if self._channel.fileno() >= 0:
            self.loop.remove(self)
            self._channel.close()


def program() -> list[str]:
    """Return the command line that starts this program again."""
    return [sys.executable] if getattr(sys, "frozen", False) else [sys.executable, "-P", "-m", "firmware"]


def die_with_parent(number: int) -> Callable[[], None]:
    """Return a function that makes the kernel send a signal to its caller when the thread that started it ends.

    The library is loaded here, and not in the returned function, which runs in a process that was just forked.
    """
    import ctypes  # takes 10 ms, which a station does not need

    prctl = ctypes.CDLL(None).prctl
    return lambda: prctl(PR_SET_PDEATHSIG, number, 0, 0, 0)


def _run(command: Sequence[str], descriptor: int) -> subprocess.Popen[bytes]:
    """Start a process that inherits one descriptor; its output goes to stderr.

    It also inherits the environment. From the `_PYI_*` variables, a program frozen into one file learns that its
    files are unpacked already, and starts no intermediate process.
    """
    path = os.pathsep.join(filter(None, (str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=2, pass_fds=[descriptor], env=environment)


def _status(code: int | None) -> str:
    if code is None or code >= 0:
        return f"status {code}"
    return signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
