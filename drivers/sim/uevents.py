"""Uevents of a simulated machine: sends the kernel's octets to all listeners."""

import socket
from contextlib import suppress
from pathlib import Path


class UeventSender:
    """Sends uevents to all listeners of a socket, without a loop: each message first accepts new connections."""

    def __init__(self, path: Path) -> None:
        self.path = str(path)
        self._number = 1000
        self._listeners: list[socket.socket] = []
        self._door = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
        self._door.bind(self.path)
        self._door.listen(16)

    def send(self, action: str, devpath: str, subsystem: str, /, **properties: str) -> None:
        """Send a message to each listener. A listener with a full queue is disconnected, which it notices."""
        self._number += 1
        said = {"ACTION": action, "DEVPATH": devpath, "SUBSYSTEM": subsystem, **properties, "SEQNUM": str(self._number)}
        octets = "\0".join([f"{action}@{devpath}", *(f"{key}={value}" for key, value in said.items()), ""]).encode()
        self._admit()
        for listener in tuple(self._listeners):
            try:
                listener.send(octets)
            except OSError:  # EAGAIN: its queue is full; EPIPE: it has gone
                self._listeners.remove(listener)
                listener.close()

    def close(self) -> None:
        """Disconnect all listeners; idempotent."""
        for each in (self._door, *self._listeners):
            each.close()
        self._listeners.clear()
        Path(self.path).unlink(missing_ok=True)

    def _admit(self) -> None:
        with suppress(BlockingIOError):
            while True:
                self._listeners.append(self._door.accept()[0])
                self._listeners[-1].setblocking(False)
