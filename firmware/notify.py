"""systemd's readiness and watchdog protocol (sd_notify(3)): one datagram to $NOTIFY_SOCKET."""

import contextlib
import os
import socket

from board.loop import Loop


class ServiceNotice:
    """Tells the service manager that the station is ready, alive or stopping; silent where there is none."""

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
        # A manager that went away is not the station's trouble.
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out,
        ):
            out.sendto(text.encode(), self._address)

    def watch(self, loop: Loop) -> None:
        """Feed the watchdog from the loop, at a third of its time, so that a stuck loop is noticed."""
        if self.watchdog_s:
            loop.every(self.watchdog_s / 3, lambda: self.send("WATCHDOG=1"))
