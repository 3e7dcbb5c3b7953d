"""Workers that prove workers: for the command `doctor`, and for the tests of the source and of the binary."""

import socket

from board.child import MAX_MESSAGE
from board.errors import InterfaceError
from board.loop import Loop
from board.worker import Worker, messages


def echo(channel: socket.socket) -> None:
    """Send every message back."""
    for message in messages(channel):
        channel.send(message)


def nest(channel: socket.socket) -> None:
    """A worker that has an echo of its own and passes on what it is told and what it sees of it.

    Up go `state <text>` and `echo <message>`.
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


WORKERS = {"echo": echo, "nest": nest}


def try_out() -> str:
    """Start a child process of this program and have it answer. Returns how that went, in words.

    Takes the time of one start: 0.1 s, longer in a binary. Raises InterfaceError when no answer comes.
    """
    loop = Loop()
    began = loop.clock()
    answers: list[str] = []

    def on_state(is_up: bool, why: str) -> None:
        if is_up:
            worker.send(b"echo")
        else:
            answers.append(why)
            loop.stop()

    def on_message(message: bytes) -> None:
        loop.stop()

    worker = Worker(loop, "echo", on_message, on_state)
    worker.start()
    loop.run()
    milliseconds = (loop.clock() - began) * 1000
    worker.finish()
    loop.close()
    if answers:
        raise InterfaceError(f"a child process of this program {answers[0]}", "look at what it printed above")
    return f"a child process answered after {milliseconds:.0f} ms"
