"""Where frames and messages come from while they come: UDP datagrams, a network device, a station's users' port."""

import socket
import struct
from collections.abc import Iterator
from typing import Protocol

from board.address import Address
from board.errors import ProtocolError, StationError
from drivers.wire import btp
from firmware.codec import capture, layers
from firmware.codec.reading import Pdu
from firmware.replay.ends import raw_socket
from firmware.user import client
from firmware.user.received import Pairing

BATCH = 64  # taken in one turn
LONGEST = 65536
RECEIVE_BUFFER = 4 << 20  # octets
GEONETWORKING = 0x8947
SOL_PACKET, ADD_MEMBERSHIP, PROMISCUOUS = 263, 1, 1  # linux/socket.h, linux/if_packet.h


class Ear(Protocol):
    """One way in; poll it as zmq does: by its descriptor, or as the socket that it is."""

    @property
    def polled(self) -> object: ...
    def hear(self) -> Iterator[Pdu]:
        """What has come, a batch of it."""


class Datagrams:
    """UDP at an address. Raises StationError where it is taken, or not ours."""

    def __init__(self, at: Address, framing: str) -> None:
        self._framing = framing
        self.polled = socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self.polled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        try:
            self.polled.bind(at)
        except OSError as error:
            raise StationError(
                f"UDP at {at}: {error.strerror}", f"`ss -ulpn sport = :{at.port}` names who has it"
            ) from error

    def hear(self) -> Iterator[Pdu]:
        for octets in _waiting(self.polled):
            if self._framing == "ethernet":
                yield framed(octets)
            elif self._framing == "pdu":
                yield Pdu(octets, "a datagram")
            elif len(octets) >= btp.SIZE:
                yield Pdu(octets[btp.SIZE :], "a datagram", int.from_bytes(octets[:2]))

    def close(self) -> None:
        self.polled.close()


class Device:
    """Frames of GeoNetworking that come in by a network device, to whomever. Raises StationError."""

    def __init__(self, name: str) -> None:
        self.polled = raw_socket(name, GEONETWORKING)
        self.polled.setblocking(False)
        self.polled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        membership = struct.pack("=iHH8s", socket.if_nametoindex(name), PROMISCUOUS, 0, b"")
        self.polled.setsockopt(SOL_PACKET, ADD_MEMBERSHIP, membership)

    def hear(self) -> Iterator[Pdu]:
        for octets in _waiting(self.polled):
            yield framed(octets)

    def close(self) -> None:
        self.polled.close()


class Station:
    """What a station's users receive. Raises StationError where none is."""

    def __init__(self, context: client.Context, place: client.Address) -> None:
        self.polled = client.subscribe(context, place, place.to_users, "raw.", "v2x.")
        self._pairing = Pairing()

    def hear(self) -> Iterator[Pdu]:
        for frames in client.waiting(self.polled, BATCH):
            message = self._pairing.feed(frames)
            if message is not None:
                yield Pdu(message.pdu, f"a {message.type or 'nameless'} message")

    def close(self) -> None:
        self.polled.close(linger=0)


def framed(octets: bytes) -> Pdu:
    """A frame and what is in it, which may be nothing."""
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
            yield descriptor.recv(LONGEST)
        except (BlockingIOError, ConnectionRefusedError):
            return
