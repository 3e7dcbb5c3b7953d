"""Minimum speed of a download: a slow server must not block updates."""

import http.client
import io
import socket
from collections.abc import Callable
from typing import Any

# Half the speed of 2G, 10 kB/s, so a connection of that speed may fail half of the time. A bundle of 168 MB takes at
# most 9 h.
WITHIN_S = 300.0
LEAST = 1_500_000  # octets to receive within WITHIN_S


class TooSlowError(Exception):
    """Too few octets arrived within WITHIN_S, over all connections."""


class Pace:
    """Measures received octets, headers included, because a server may also send headers slowly."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._since = clock()
        self._came = 0

    def take(self, octets: int) -> None:
        """Count received octets. Raises TooSlowError if fewer than LEAST came within WITHIN_S."""
        self._came += octets
        took_s = self._clock() - self._since
        if took_s < WITHIN_S:
            return
        if self._came < LEAST:
            least = f"{LEAST / 1000:.0f} kB within {WITHIN_S:.0f} s"
            raise TooSlowError(f"{self._came / 1000:.0f} kB received within {took_s:.0f} s; the minimum is {least}")
        self._since += took_s
        self._came = 0


def paced(pace: Pace) -> type[http.client.HTTPResponse]:
    """Return a class of responses that report each read to a Pace."""

    class Response(http.client.HTTPResponse):
        def __init__(self, sock: socket.socket, debuglevel: int = 0, method: str | None = None) -> None:
            super().__init__(sock, debuglevel, method)
            self.fp = io.BufferedReader(_Counted(self.fp.detach(), pace))

    return Response


class _Counted(io.RawIOBase):
    def __init__(self, raw: io.RawIOBase, pace: Pace) -> None:
        self._raw = raw
        self._pace = pace

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int | None:
        octets = self._raw.readinto(buffer)
        self._pace.take(octets or 0)
        return octets

    def close(self) -> None:
        self._raw.close()
        super().close()
