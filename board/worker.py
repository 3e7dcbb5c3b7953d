"""A child process of the same program behind a Source: for a library that blocks, floods or may crash.

Messages of 1 to 64 KiB go both ways over a SOCK_SEQPACKET pair, whole and in order. What the two sides say in
them is theirs. The child is started again when it ends, and ends with its parent whatever happened to it.
"""

import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence

from board.child import GRACE_S, HELLO, MAX_MESSAGE, Child, die_with_parent, program
from board.errors import RequestError
from board.loop import Loop, Timer

FIRST_DELAY_S = 0.2  # before the first restart, doubled with each that follows
LONGEST_DELAY_S = 30.0
STEADY_S = 10.0  # up for so long: the next failure begins at FIRST_DELAY_S again


def jitter() -> float:
    """0 to 1, so that workers which failed together are not started together."""
    return os.urandom(1)[0] / 255


class Worker:
    """A child that is kept running: the parent's side.

    name         of the function that runs in the child.
    on_message   called with each message of the child.
    on_state     called with whether it runs, and why: its process id, or what ended it and when it starts again.
    on_writable  called when send() takes messages again after it refused one because too many waited.
    command      that leads to child(); empty for this program itself.
    silence_s    a child that runs and has said nothing for so long is killed and started again: for one that says
                 something at least twice in that time. 0 for others.
    """

    def __init__(
        self,
        loop: Loop,
        name: str,
        on_message: Callable[[bytes], None],
        on_state: Callable[[bool, str], None],
        on_writable: Callable[[], None] = lambda: None,
        *,
        command: Sequence[str] = (),
        silence_s: float = 0.0,
        jitter: Callable[[], float] = jitter,
    ) -> None:
        self.loop = loop
        self.name = name
        self.message = on_message
        self.writable = on_writable
        self.restarts = 0
        self.refused = 0  # messages that send() did not take
        self._on_state = on_state
        self._command = command
        self._silence_s = silence_s
        self._jitter = jitter
        self._child: Child | None = None
        self._leaving: list[Child] = []
        self._restart: Timer | None = None
        self._failures = 0
        self._up_since: float | None = None
        self._lost = self._longest = 0

    @property
    def is_up(self) -> bool:
        return self._child is not None and self._child.is_up

    @property
    def queued(self) -> int:
        """Messages that wait for the child."""
        return len(self._child.queue) if self._child else 0

    @property
    def longest(self) -> int:
        """The most messages that ever waited."""
        return max(self._longest, self._child.longest if self._child else 0)

    @property
    def lost(self) -> int:
        """Messages that waited for a child when it ended."""
        return self._lost

    def start(self) -> None:
        """Start the child and return at once; on_state tells when it runs. Without effect while started."""
        if self._child is None and self._restart is None:
            self._failures = 0
            self._spawn()

    def send(self, message: bytes) -> bool:
        """Hand a message to the child. False, and counted as refused: it does not run, or too many wait.

        Raises RequestError for a message that is empty or longer than MAX_MESSAGE.
        """
        if not 0 < len(message) <= MAX_MESSAGE:
            raise RequestError(f"worker {self.name}: {len(message)} octets are not 1 to {MAX_MESSAGE}")
        is_taken = self._child is not None and self._child.send(message)
        self.refused += not is_taken
        return is_taken

    def stop(self) -> None:
        """Let the child go and return at once; idempotent. Nothing is called back any more.

        Its socket is closed; if that does not make it end within GRACE_S, the loop kills it.
        """
        if self._restart is not None:
            self._restart.cancel()
            self._restart = None
        if self._child is not None:
            self._child.leave()
            self._leaving.append(self._child)
            self._forget(self._child)

    def finish(self, within: float = GRACE_S) -> None:
        """stop() for the end of the program, where the loop turns no more: returns when the child is gone.

        Waits here for `within` seconds, then kills it.
        """
        self.stop()
        for child in tuple(self._leaving):
            child.finish(within)

    def up(self, child: Child, pid: int) -> None:
        self._up_since = self.loop.clock()
        self._on_state(True, f"process {pid} runs")

    def ended(self, child: Child, why: str) -> None:
        if child in self._leaving:
            self._leaving.remove(child)
            return
        if self._up_since is not None and self.loop.clock() - self._up_since >= STEADY_S:
            self._failures = 0
        self._forget(child)
        self._again(why)

    def _spawn(self) -> None:
        self._restart = None
        self._up_since = None
        try:
            self._child = Child(self.loop, self, self._command or program(), self.name, self._silence_s)
        except OSError as error:
            self._again(f"cannot be started: {error.strerror}")

    def _again(self, why: str) -> None:
        delay = min(LONGEST_DELAY_S, FIRST_DELAY_S * 2.0 ** min(self._failures, 16))
        delay *= 0.5 + self._jitter() / 2
        self._failures += 1
        self.restarts += 1
        self._restart = self.loop.after(delay, self._spawn)
        self._on_state(False, f"{why}; starts again in {delay:.1f} s")

    def _forget(self, child: Child) -> None:
        self._lost += child.lost
        self._longest = max(self._longest, child.longest)
        self._child = None


# The child's side.


# What a worker does: it is given the blocking socket, and returns when messages() ends.
Serve = Callable[[socket.socket], None]


def child(arguments: Sequence[str], workers: Mapping[str, Callable[[], Serve]]) -> int:
    """Run the worker that the command line names, `captain --worker NAME FD`; returns the exit status.

    workers  by name what brings a worker, with all that it imports: the parent is told that it runs afterwards, and
             counts its time from there.
    """
    if len(arguments) != 4 or arguments[2] not in workers or not arguments[3].isdecimal():
        print(f"{arguments[0]}: --worker is for this program's own use", file=sys.stderr)
        return 2
    name, descriptor = arguments[2], int(arguments[3])
    # Signals of a terminal or a service manager go to the whole group; the parent decides when this one ends.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    die_with_parent(signal.SIGKILL)()
    with socket.socket(fileno=descriptor) as channel:
        try:
            serve = workers[name]()
            # Only the parent holds the other end. Had it ended before that, this would fail.
            channel.send(HELLO)
            serve(channel)
        except (BrokenPipeError, ConnectionResetError):
            return 0  # the parent has closed its end: that is how it says stop
    return 0


def messages(channel: socket.socket) -> Iterator[bytes]:
    """What the parent sends, until it says stop."""
    while message := channel.recv(MAX_MESSAGE):
        yield message
