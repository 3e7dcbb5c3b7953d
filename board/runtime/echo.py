"""Workers for tests of workers, by `captain doctor` and the test suite."""

import socket
from collections.abc import Callable, Mapping, Sequence

from board.runtime.child import MAX_MESSAGE
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from board.runtime.worker import Serve, Worker, messages

# Limit for an answer: it takes 0.1 ms, and a second on a machine that swaps.
ANSWER_S = 5.0


def echo(channel: socket.socket) -> None:
    """Send each message back."""
    for message in messages(channel):
        channel.send(message)


def prove_nesting(channel: socket.socket) -> None:
    """Start an echo worker from within a worker, and report its states and answers to the parent.

    It sends `state <text>` and `echo <message>`. A test sees by them that a frozen program can start itself from a
    worker, and that the echo ends with its parent.
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
    """Start a child process of this program, wait for its answer, and return the result in words.

    command   command line of the worker; see Worker.
    patience  seconds that a started child has for its answer.

    Takes as long as one start: 0.1 s, longer for a frozen program. Raises InterfaceError without an answer.
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
            loop.after(patience, lambda: fail(f"runs but timed out after {patience:g} s"))
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
        raise InterfaceError(f"a child process of this program {failures[0]}", "see its output above")
    return f"a child process answered after {milliseconds:.0f} ms"
