"""Service notices to systemd: readiness and watchdog (sd_notify(3))."""

import contextlib
import os
import socket

from board.runtime.loop import Loop


class ServiceNotice:
    """Sender of datagrams to $NOTIFY_SOCKET: the station is ready, alive or stopping. Without it, nothing is sent.

    watchdog_s  time in seconds within which systemd expects a notice; 0 without a watchdog.
    """

    def __init__(self, environment: dict[str, str] | None = None) -> None:
        environment = dict(os.environ) if environment is None else environment
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        is_ours = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        watchdog_us = environment.get("WATCHDOG_USEC", "") if is_ours else ""
        self.watchdog_s = int(watchdog_us) / 1e6 if watchdog_us.isdecimal() else 0.0

    def send(self, text: str) -> None:
        if not self._address:
            return
        # Errors are ignored: the station works without its service manager.
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out,
        ):
            out.sendto(text.encode(), self._address)

    def watch(self, loop: Loop) -> None:
        """Notify the watchdog from the loop, three times within its time, so that systemd detects a loop that hangs."""
        if self.watchdog_s:
            loop.every(self.watchdog_s / 3, lambda: self.send("WATCHDOG=1"))
