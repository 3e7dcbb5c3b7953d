"""A connection to a broker, between paho-mqtt and the socket: paho is given whole packets only."""

import select
import socket
import ssl
import struct
from collections.abc import Iterator
from contextlib import suppress

from drivers.wire.mqtt_packets import Oversized, Packets
from drivers.wire.v2n_message import MAX_PAYLOAD

# Beside a payload: the topic, user properties and what else a PUBLISH carries.
MAX_PACKET = MAX_PAYLOAD + 8192  # octets

READ = 65536  # octets at once

_AT_ONCE = struct.pack("ii", 1, 0)  # socket(7), SO_LINGER: struct linger


class Line:
    """What paho takes for its socket.

    is_closed  paho wants no more of it; end() closes it.
    """

    def __init__(self, connection: socket.socket) -> None:
        self.is_closed = False
        self._connection = connection
        self._error: OSError | None = None  # that the last write ended with
        self._packets = Packets(MAX_PACKET)
        self._whole = b""
        self._at = 0

    # paho's side.

    def recv(self, size: int) -> bytes:
        """Of whole packets only."""
        at = self._at
        found = self._whole[at : at + size]
        if not found:
            raise BlockingIOError
        self._at = at + len(found)
        return found

    def send(self, octets: bytes) -> int:
        try:
            return self._connection.send(octets)
        except (ssl.SSLWantWriteError, ssl.SSLWantReadError, BlockingIOError) as error:
            raise BlockingIOError from error
        except OSError as error:
            self._error = error
            raise

    def fileno(self) -> int:
        return self._connection.fileno()

    def setblocking(self, flag: bool) -> None:
        """It never blocks."""

    def close(self) -> None:
        self.is_closed = True

    # Ours.

    @property
    def has_room(self) -> bool:
        """Whether little in the kernel has not left (TCP_NOTSENT_LOWAT). From who does not ask it takes 30 kB more."""
        return bool(select.select([], [self._connection.fileno()], [], 0)[1])

    @property
    def has_packets(self) -> bool:
        """Whether paho has not read all of the last packets."""
        return self._at < len(self._whole)

    def put(self, packet: bytes) -> None:
        """Give paho a packet to read."""
        self._whole, self._at = packet, 0

    def read(self) -> Iterator[bytes | Oversized]:
        """What has arrived, once. Raises OSError, EOFError when the broker has closed, ProtocolError."""
        try:
            self._look()
            octets = self._connection.recv(READ)
        except (ssl.SSLWantWriteError, ssl.SSLWantReadError, BlockingIOError):
            return iter(())
        if not octets:
            raise EOFError
        return self._packets.receive(octets)

    def _look(self) -> None:
        """Raise what the network has ended the connection with: TLS would call it the broker's end."""
        with suppress(BlockingIOError):
            socket.socket.recv(self._connection, 1, socket.MSG_PEEK)

    @property
    def has_more(self) -> bool:
        """Whether octets were decrypted that no poll tells of."""
        return isinstance(self._connection, ssl.SSLSocket) and self._connection.pending() > 0

    def cause(self) -> OSError | None:
        """Why a write has failed, if one has: what the broker has said before it closed says more than that it did."""
        if self._error is None:
            return None
        try:
            self._connection.recv(READ)
        except (ssl.SSLWantReadError, ssl.SSLEOFError):
            pass
        except ssl.SSLError as error:
            return error
        except OSError:
            pass
        return self._error

    def shut(self) -> None:
        """Nothing more will be written: the broker reads to the end, then closes."""
        self._connection.shutdown(socket.SHUT_WR)

    def skip(self) -> None:
        """Read what comes after shut() and forget it: TLS is over by then. Raises OSError, EOFError at the end."""
        with suppress(BlockingIOError):
            if not socket.socket.recv(self._connection, READ):
                raise EOFError

    def end(self) -> None:
        self._connection.close()

    def discard(self) -> None:
        """End it at once: what the kernel has still to send would arrive late, and is not sent."""
        with suppress(OSError):  # it has ended already
            self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
        self._connection.close()
