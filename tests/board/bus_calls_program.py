"""A program whose workers are the board's, simulated: sound ones, and some that fail in their own way."""

import os
import socket
import sys

from board.bus_calls import serve
from board.runtime.worker import child, messages
from drivers.sim.chips import serve_simulated


def crash(channel: socket.socket) -> None:
    """Ends in the middle of the first call."""
    incoming = messages(channel)
    next(incoming)
    next(incoming)
    os._exit(3)


WORKERS = {"board": lambda: serve, "board-sim": lambda: serve_simulated, "crash": lambda: crash}

if __name__ == "__main__":
    sys.exit(child(sys.argv, WORKERS))
