"""A program whose workers misbehave, each in its own way; started by test_worker.py."""

import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from functools import partial

from board.runtime.echo import echo
from board.runtime.worker import Serve, child, messages

# Before the first message goes up: the test sends it as soon as the worker runs.
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})


def crash(channel: socket.socket) -> None:
    """Leaves at the first message, with the status that it names."""
    os._exit(int(channel.recv(10)))


def fail(channel: socket.socket) -> None:
    raise ZeroDivisionError


def deaf(channel: socket.socket) -> None:
    """Reads nothing before SIGUSR1, then echoes."""
    signal.sigwait({signal.SIGUSR1})
    echo(channel)


def flood(channel: socket.socket) -> None:
    """Sends as many messages as it is told, then leaves."""
    for number in range(int(channel.recv(10))):
        channel.send(str(number).encode())


def long(channel: socket.socket) -> None:
    """Sends a message that is one octet too long."""
    channel.send(bytes(65537))
    signal.pause()


def stubborn(channel: socket.socket) -> None:
    """Stays when it is told to leave."""
    for _ in messages(channel):
        pass
    time.sleep(60)


def closer(channel: socket.socket) -> None:
    """Closes its socket and stays."""
    channel.close()
    time.sleep(60)


def descriptors(channel: socket.socket) -> None:
    """Tells which descriptors it has."""
    for _ in messages(channel):
        mine = [name for name in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{name}")]
        channel.send(" ".join(sorted(mine)).encode() + f" of {channel.fileno()}".encode())


def printer(channel: socket.socket) -> None:
    """Prints what it is told."""
    for message in messages(channel):
        print(message.decode(), flush=True)
        channel.send(message)


def unfit() -> Serve:
    """Ends before it is there."""
    os._exit(7)


SERVE: tuple[Serve, ...] = (echo, crash, fail, deaf, flood, long, stubborn, closer, descriptors, printer)
WORKERS: dict[str, Callable[[], Serve]] = {serve.__name__: partial(lambda serve: serve, serve) for serve in SERVE}
WORKERS["unfit"] = unfit

if __name__ == "__main__":
    sys.exit(child(sys.argv, WORKERS))
