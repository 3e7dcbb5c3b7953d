"""Workers that prove workers: for the command `doctor`, and for the tests of the source and of the binary."""

import socket
from collections.abc import Callable, Mapping, Sequence

from board.child import MAX_MESSAGE
from board.errors import InterfaceError
from board.loop import Loop
from board.worker import Serve, Worker, messages

# An echo takes a tenth of a millisecond; a machine that swaps needs a second.
ANSWER_S = 5.0


def echo(channel: socket.socket) -> None:
    """Send every message back."""
    for message in messages(channel):
        channel.send(message)


def prove_nesting(channel: socket.socket) -> None:
    """A worker that has a worker, an echo, and passes on what it is told and what it sees of it.

    With it a test sees that a frozen program starts itself from within itself, and that the echo ends with its
    parent. Up go `state <text>` and `echo <message>`.
    """
    loop = Loop()
    worker = Worker(
        loop,
        "echo",
        on_message=lambda message: _tell(channel, b"echo " + message),
        on_state=lambda is_up, why: _tell(channel, b"state " + why.encode()),
    )

    class Above:
        def fileno(self) -> int:
            return channel.fileno()

        def ready(self, events: int) -> None:
            message = channel.recv(MAX_MESSAGE)
            if message:
                worker.send(message)
            else:
                loop.stop()

    loop.add(Above())
    worker.start()
    loop.run()


def _tell(channel: socket.socket, message: bytes) -> None:
    channel.send(message)


WORKERS: Mapping[str, Callable[[], Serve]] = {"echo": lambda: echo, "prove-nesting": lambda: prove_nesting}


def try_out(command: Sequence[str] = (), patience: float = ANSWER_S) -> str:
    """Start a child process of this program and have it answer. Returns how that went, in words.

    command   as Worker has it.
    patience  seconds that a child which runs has for its answer.

    Takes the time of one start: 0.1 s, longer in a binary. Raises InterfaceError when no answer comes.
    """
    loop = Loop()
    began = loop.clock()
    failures: list[str] = []

    def fail(why: str) -> None:
        failures.append(why)
        loop.stop()

    def on_state(is_up: bool, why: str) -> None:
        if is_up:
            worker.send(b"echo")
            loop.after(patience, lambda: fail(f"runs and did not answer within {patience:g} s"))
        else:
            fail(why)

    def on_message(message: bytes) -> None:
        loop.stop()

    worker = Worker(loop, "echo", on_message, on_state, command=command)
    worker.start()
    loop.run()
    milliseconds = (loop.clock() - began) * 1000
    worker.finish()
    loop.close()
    if failures:
        raise InterfaceError(f"a child process of this program {failures[0]}", "look at what it printed above")
    return f"a child process answered after {milliseconds:.0f} ms"
