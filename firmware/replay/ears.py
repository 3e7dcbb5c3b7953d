"""Receiving ends: UDP datagrams, a network device, a station's port for users."""

import errno
import socket
import struct
from collections.abc import Iterator
from typing import Protocol

import zmq

from board.runtime.address import Address
from board.runtime.errors import ProtocolError, StationError
from drivers.packet.intake import KernelDrops, enlarge
from drivers.wire import btp
from firmware.client import client
from firmware.client.received import Pairing
from firmware.codec.reading import Pdu
from firmware.recordings import capture, layers
from firmware.replay.ends import raw_socket
from firmware.untrusted import number, within

BATCH = 64  # messages taken in one turn
LONGEST = 65536
RECEIVE_BUFFER = 4 << 20  # octets that wait in the kernel at most
GEONETWORKING = 0x8947
# Constants of linux/socket.h and linux/if_packet.h.
SOL_PACKET, ADD_MEMBERSHIP, STATISTICS, PROMISCUOUS = 263, 1, 6, 1
# Errors that a socket reports once when its peer or device is down; it works again when they are up.
PASSING = frozenset({errno.ECONNREFUSED, errno.ENETDOWN, errno.ENETUNREACH, errno.EHOSTUNREACH})


class Ear(Protocol):
    """Receiving end.

    polled  descriptor or socket for zmq's poll().
    missed  messages that the kernel dropped because this program was too slow.
    """

    missed: int

    @property
    def polled(self) -> object: ...
    def hear(self) -> Iterator[Pdu]:
        """Yield a batch of the messages that have arrived."""


class Datagrams:
    """Receiving end for UDP at an address. Raises StationError if the address is in use or not on this machine."""

    def __init__(self, at: Address, framing: str) -> None:
        self.missed = 0
        self._framing = framing
        self.polled = socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._drops = KernelDrops(self.polled)
        enlarge(self.polled, RECEIVE_BUFFER)
        try:
            self.polled.bind(at)
        except OSError as error:
            raise StationError(
                f"UDP at {at}: {error.strerror}", f"`ss -ulpn sport = :{at.port}` names who has it"
            ) from error

    def hear(self) -> Iterator[Pdu]:
        """Yield the messages that have arrived. Raises StationError if receiving fails permanently."""
        self.missed += self._drops.take()
        for octets in _waiting(self.polled):
            if self._framing == "ethernet":
                yield framed(octets)
            elif self._framing == "pdu":
                yield Pdu(octets, "a datagram", carried="an empty datagram")
            elif len(octets) < btp.SIZE:
                yield Pdu(b"", "a datagram", carried="shorter than a BTP header")
            else:
                yield Pdu(octets[btp.SIZE :], "a datagram", int.from_bytes(octets[:2]), carried="nothing behind BTP")

    def close(self) -> None:
        self.polled.close()


class DeviceEar:
    """Receiving end for GeoNetworking frames of a network device, whatever their destination.

    Raises StationError if the device is missing or raw sockets are not permitted.
    """

    def __init__(self, name: str) -> None:
        self.missed = 0
        self.polled = raw_socket(name, GEONETWORKING)
        self.polled.setblocking(False)
        enlarge(self.polled, RECEIVE_BUFFER)
        membership = struct.pack("=iHH8s", socket.if_nametoindex(name), PROMISCUOUS, 0, b"")
        self.polled.setsockopt(SOL_PACKET, ADD_MEMBERSHIP, membership)

    def hear(self) -> Iterator[Pdu]:
        """Yield the messages that have arrived. Raises StationError if receiving fails permanently."""
        # struct tpacket_stats: packets, drops. Reading resets both to 0.
        self.missed += struct.unpack("=II", self.polled.getsockopt(SOL_PACKET, STATISTICS, 8))[1]
        for octets in _waiting(self.polled):
            yield framed(octets)

    def close(self) -> None:
        self.polled.close()


class StationEar:
    """Receiving end for messages that a station sends to its users. Raises StationError if no station answers.

    Messages that the station publishes faster than this program reads are not counted here. The station reports
    only the number of times that a user was too slow.
    """

    missed = 0

    def __init__(self, context: client.Context, place: client.Address) -> None:
        self.polled = client.subscribe(context, place, place.to_users, "raw.", "v2x.")
        self._reports = client.subscribe(context, place, place.report)
        self._pairing = Pairing()
        self._slow_before = self._slow_count()

    def fell_behind(self) -> int:
        """Return how often any user of the station was too slow since this program listens."""
        return max(0, self._slow_count() - self._slow_before)

    def _slow_count(self) -> int:
        for _ in client.waiting(self._reports):  # discard an old status
            pass
        self._reports.setsockopt(zmq.SUBSCRIBE, b"status.")
        status = client.next_report(self._reports, "status.") or {}
        self._reports.setsockopt(zmq.UNSUBSCRIBE, b"status.")
        return int(number(within(status, "endpoint"), "slow_count"))

    def hear(self) -> Iterator[Pdu]:
        for frames in client.waiting(self.polled, BATCH):
            message = self._pairing.feed(frames)
            if message is not None:
                yield Pdu(message.pdu, f"a {message.type or 'nameless'} message")

    def close(self) -> None:
        self.polled.close(linger=0)
        self._reports.close(linger=0)


def framed(octets: bytes) -> Pdu:
    """Return a frame with the message inside it, if it contains one."""
    try:
        found = layers.open_frame(capture.ETHERNET, octets)
    except ProtocolError as error:
        found = layers.NoMessage(f"broken: {error.message}")
    if isinstance(found, layers.NoMessage):
        return Pdu(b"", "a frame", carried=found.what, frame=octets)
    return Pdu(found.pdu, "a frame", found.btp_port, carried=str(found), frame=octets)


def _waiting(descriptor: socket.socket) -> Iterator[bytes]:
    for _ in range(BATCH):
        try:
            octets = descriptor.recv(LONGEST)
        except BlockingIOError:
            return
        except OSError as error:
            if error.errno not in PASSING:
                raise StationError(f"receiving: {error.strerror}") from error
            return
        yield octets
