"""How fast a bundle has to come: a server that drips octets would hold the lock of updates for days."""

import http.client
import io
import socket
from collections.abc import Callable
from typing import Any

# Half of what 2G brings, 10 kB/s: so slow a way may be away for half of the time. A bundle of 168 MB takes 9 h at most.
WITHIN_S = 300.0
LEAST = 1_500_000  # octets


class TooSlowError(Exception):
    """Too little came, of one connection or of several."""


class Pace:
    """Octets as they come, headers among them: those may be dripped as well."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._since = clock()
        self._came = 0

    def take(self, octets: int) -> None:
        """So many came just now. Raises TooSlowError where it were less than LEAST within WITHIN_S."""
        self._came += octets
        took_s = self._clock() - self._since
        if took_s < WITHIN_S:
            return
        if self._came < LEAST:
            least = f"{LEAST / 1000:.0f} kB within {WITHIN_S:.0f} s"
            raise TooSlowError(f"{self._came / 1000:.0f} kB came within {took_s:.0f} s, and {least} are the least")
        self._since += took_s
        self._came = 0


def paced(pace: Pace) -> type[http.client.HTTPResponse]:
    """Responses whose every read is told to a pace."""

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
