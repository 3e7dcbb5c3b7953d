"""Connection to a broker, between paho-mqtt and the socket; paho gets complete packets only."""

import select
import socket
import ssl
import struct
from collections.abc import Iterator
from contextlib import suppress

from drivers.wire.mqtt_packets import Oversized, Packets
from drivers.wire.v2n.message import MAX_PAYLOAD

# Longest packet: the longest payload, and room for topic, user properties and other fields of a PUBLISH.
MAX_PACKET = MAX_PAYLOAD + 8192  # octets

READ = 65536  # octets per read

_AT_ONCE = struct.pack("ii", 1, 0)  # struct linger of SO_LINGER (socket(7)) for a close that discards unsent octets


class BrokerLine:
    """Object that paho uses as its socket.

    is_closed  True after paho has closed it; the real socket stays open until end().
    """

    def __init__(self, connection: socket.socket) -> None:
        self.is_closed = False
        self._connection = connection
        self._error: OSError | None = None  # error of the last write that failed
        self._packets = Packets(MAX_PACKET)
        self._whole = b""
        self._at = 0

    # Calls of paho.

    def recv(self, size: int) -> bytes:
        """Return octets of the packet of put(). Raises BlockingIOError if paho has read all of them."""
        at = self._at
        found = self._whole[at : at + size]
        if not found:
            raise BlockingIOError
        self._at = at + len(found)
        return found

    def send(self, octets: bytes) -> int:
        """Send octets; return the number sent. Raises BlockingIOError if the socket is full, OSError if it failed."""
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
        """Do nothing: the socket is non-blocking in any case, and paho calls this method."""

    def close(self) -> None:
        self.is_closed = True

    # Calls of Network.

    @property
    def has_room(self) -> bool:
        """Whether few octets in the kernel are unsent (TCP_NOTSENT_LOWAT).

        A writer that does not check this can fill the kernel with 30 kB more.
        """
        return bool(select.select([], [self._connection.fileno()], [], 0)[1])

    @property
    def has_packets(self) -> bool:
        """Whether paho has not yet read all octets of the last packet."""
        return self._at < len(self._whole)

    def put(self, packet: bytes) -> None:
        """Give paho a packet to read."""
        self._whole, self._at = packet, 0

    def read(self) -> Iterator[bytes | Oversized]:
        """Read once from the socket; return an iterator over complete packets.

        Raises OSError if the network has cut the connection, EOFError if the broker has closed it, ProtocolError for a
        malformed packet.
        """
        try:
            self._look()
            octets = self._connection.recv(READ)
        except (ssl.SSLWantWriteError, ssl.SSLWantReadError, BlockingIOError):
            return iter(())
        if not octets:
            raise EOFError
        return self._packets.receive(octets)

    def _look(self) -> None:
        """Raise the OSError with which the network ended the connection; TLS would report an end by the broker."""
        with suppress(BlockingIOError):
            socket.socket.recv(self._connection, 1, socket.MSG_PEEK)

    @property
    def has_more(self) -> bool:
        """Whether the TLS layer has decrypted octets, which select() does not report."""
        return isinstance(self._connection, ssl.SSLSocket) and self._connection.pending() > 0

    def cause(self) -> OSError | None:
        """Return the cause of a failed write, or None if no write failed.

        A TLS alert that the broker sent before it closed the connection explains more than the failed write itself.
        """
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
        """Shut down writing: the broker then reads the rest and closes the connection."""
        self._connection.shutdown(socket.SHUT_WR)

    def skip(self) -> None:
        """Read and discard octets after shut(), below TLS.

        Raises OSError if the network has cut the connection, EOFError if the broker has closed it.
        """
        with suppress(BlockingIOError):
            if not socket.socket.recv(self._connection, READ):
                raise EOFError

    def end(self) -> None:
        self._connection.close()

    def discard(self) -> None:
        """Close the socket and discard unsent octets, which would arrive too late."""
        with suppress(OSError):  # the connection may already have ended
            self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
        self._connection.close()
