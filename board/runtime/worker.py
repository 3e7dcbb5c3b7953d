"""Worker: a supervised child process for a library that blocks or may crash.

Messages of 1 to 64 KiB go both ways over a SOCK_SEQPACKET pair, whole and in order. Their meaning is up to the two
ends.

Rules:

# state      meaning                           event                                      -> state
#
# stopped    before start(), after stop()      start()                                       starting
# starting   the process exists, silent yet    HELLO, after its imports                      up
#                                              START_S is over, or another first message     waiting (killed)
#                                              it cannot be started, ends, closes its socket waiting
# up         send() takes messages             it ends or closes its socket                  waiting
#                                              nothing said for silence_s                    waiting (killed)
# waiting    the back-off runs                 0.2 s, doubled up to 30 s, with jitter        starting
# any        stop() -> stopped. finish() -> stopped, and returns when the child is gone

The driver that owns a worker calls start(), send() and stop(), on the loop. It may call stop() from inside a callback;
no callback follows. The program calls finish() at its end, after the loop. In every state but `up`, and while QUEUE
messages wait, send() returns False. on_writable reports when half of them have left.
START_S and QUEUE are constants of child.py.

A child that was up for STEADY_S starts again after the shortest delay. All messages of an ended child are passed on
before on_state() reports its end.

Silence is counted by checks of the loop, not by the clock, so that a pause of the station does not kill its child.
Earlier versions, without silence_s, showed a process that SIGSTOP held as up for ever. The child asks the kernel for a
signal at its parent's death. If the parent ended before that request, sending HELLO fails and the child exits.
"""

import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence

from board.runtime.child import GRACE_S, HELLO, MAX_MESSAGE, Child, die_with_parent, program
from board.runtime.errors import RequestError
from board.runtime.loop import Loop, Timer

FIRST_DELAY_S = 0.2  # delay of the first restart; doubled with each further one
LONGEST_DELAY_S = 30.0
STEADY_S = 10.0  # a child that fails at each start ends sooner


def jitter() -> float:
    """Return a random number, 0 to 1, so that workers which failed together do not restart together."""
    return os.urandom(1)[0] / 255


class Worker:
    """Keeps a child process running: the parent's side.

    name         name of the function that runs in the child.
    on_message   called with each message of the child.
    on_state     called with true when the child runs and its process id, or with false, its end and the time of the
                 restart in words.
    on_writable  called when send() takes messages again after the queue was full.
    command      command line that leads to child(); empty: this program.
    steady_s     a child that was up for this time starts again with FIRST_DELAY_S after its next failure.
    silence_s    a child that sends nothing for this time is killed and restarted. Use it for children that send
                 at least twice in that time; 0 for others.
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
    ) -> None:
        self.loop = loop
        self.name = name
        self.message = on_message
        self.writable = on_writable
        self.restarts = 0
        self.steady_s = STEADY_S
        self.refused = 0  # number of messages that send() did not take
        self._on_state = on_state
        self._command = command
        self._silence_s = silence_s
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
        """Number of messages that wait for the child."""
        return len(self._child.queue) if self._child else 0

    @property
    def longest(self) -> int:
        """Greatest number of messages that ever waited."""
        return max(self._longest, self._child.longest if self._child else 0)

    @property
    def lost(self) -> int:
        """Number of messages that were still queued when a child ended."""
        return self._lost

    def start(self) -> None:
        """Start the child and return at once; on_state reports when it runs. Without effect if started already."""
        if self._child is None and self._restart is None:
            self._failures = 0
            self._spawn()

    def send(self, message: bytes) -> bool:
        """Send a message to the child. Return False, and count it as refused, if no child runs or the queue is full.

        Raises RequestError if the message is empty or longer than MAX_MESSAGE.
        """
        if not 0 < len(message) <= MAX_MESSAGE:
            raise RequestError(f"worker {self.name}: message of {len(message)} octets; 1 to {MAX_MESSAGE}")
        is_taken = self._child is not None and self._child.send(message)
        self.refused += not is_taken
        return is_taken

    def stop(self) -> None:
        """Stop the child and return at once; idempotent. No callback follows.

        The child's socket is closed. If the child does not end within GRACE_S, the loop kills it.
        """
        if self._restart is not None:
            self._restart.cancel()
            self._restart = None
        if self._child is not None:
            self._child.leave()
            self._leaving.append(self._child)
            self._forget(self._child)

    def finish(self, within: float = GRACE_S) -> None:
        """Stop at the end of the program, after the loop has ended; return when the child has ended.

        Kills the child after `within` seconds.
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
        if self._up_since is not None and self.loop.clock() - self._up_since >= self.steady_s:
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
        delay *= 0.5 + jitter() / 2
        self._failures += 1
        self.restarts += 1
        self._restart = self.loop.after(delay, self._spawn)
        self._on_state(False, f"{why}; starts again in {delay:.1f} s")

    def _forget(self, child: Child) -> None:
        self._lost += child.lost
        self._longest = max(self._longest, child.longest)
        self._child = None


# The child's side.


# Main function of a worker: it receives the blocking socket, and returns when messages() ends.
Serve = Callable[[socket.socket], None]


def child(arguments: Sequence[str], workers: Mapping[str, Callable[[], Serve]]) -> int:
    """Run the worker that the command line `captain --worker NAME FD` names; return the exit status.

    workers  by name, a function that imports the worker and returns its main function. HELLO is sent after it, so
             the parent counts the worker as up from then.
    """
    if len(arguments) != 4 or arguments[2] not in workers or not arguments[3].isdecimal():
        print(f"{arguments[0]}: --worker is internal", file=sys.stderr)
        return 2
    name, descriptor = arguments[2], int(arguments[3])
    # A terminal or a service manager signals the whole process group; the parent decides when this process ends.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    die_with_parent(signal.SIGKILL)()
    with socket.socket(fileno=descriptor) as channel:
        try:
            serve = workers[name]()
            # Only the parent holds the other end, so this fails if the parent has ended already.
            channel.send(HELLO)
            serve(channel)
        except (BrokenPipeError, ConnectionResetError):
            return 0  # the parent closed its end, which means stop
    return 0


def messages(channel: socket.socket) -> Iterator[bytes]:
    """Yield the parent's messages until it closes the channel."""
    while message := channel.recv(MAX_MESSAGE):
        yield message
