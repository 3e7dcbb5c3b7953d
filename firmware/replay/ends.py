"""Sending ends: a station's endpoint, UDP datagrams, a network device."""

import json
import socket
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Protocol

import zmq

from board.runtime.address import Address
from board.runtime.errors import ProtocolError, RequestError, StationError
from drivers.message import Shape
from drivers.packet.intake import not_permitted
from drivers.wire import btp
from drivers.wire import frame as ethernet
from drivers.wire.geonet import packet as geonet_packet
from drivers.wire.geonet.header import BasicNext, HeaderType
from drivers.wire.geonet.packet import GeoArea
from firmware.client import client
from firmware.client.sending import sending
from firmware.client.sending.account import fate
from firmware.client.sending.flights import Flight
from firmware.client.sending.payload import Payload
from firmware.codec.reading import Pdu
from firmware.codec.writing import framed
from firmware.replay.reasons import count

SEND_BUFFER = 1 << 20  # octets; a burst at full speed waits in the kernel
GEO_BROADCASTS = range(HeaderType.GBC_CIRCLE, HeaderType.GBC_ELLIPSE + 1)


class End(Protocol):
    """Sending end."""

    def octets(self, one: Pdu) -> bytes:
        """Return the octets of a message in the form for this end. Raises RequestError if it has no such form."""

    def send(self, octets: bytes, one: Pdu) -> None:
        """Send octets, which the lossy link may have changed since octets().

        Raises RequestError if they cannot be sent.
        """

    def wait(self, until: float) -> None:
        """Wait until a monotonic time in seconds; receive answers meanwhile."""


class StationEnd:
    """Sending end to a station's PULL socket, with a confirm for each message.

    fates     number of messages that no interface sent, by reason.
    firsts    place in the input of the first message with each reason.
    is_paced  the caller decides when to send; otherwise the number of unconfirmed messages is limited.

    Raises StationError if no station answers, and later if it stops accepting or confirming messages.
    """

    def __init__(self, context: client.Context, place: client.Address, program: str, is_paced: bool) -> None:
        self.fates: Counter[str] = Counter()
        self.firsts: dict[str, str] = {}
        confirms = sending.confirms(context, place)
        label = f"captain-{program}-{time.time_ns():x}"
        self._sending = sending.Sending(
            client.push(context, place), confirms, label=label, options={}, interval=0.0, on_over=self._over
        )
        self._is_paced = is_paced

    @property
    def outcomes(self) -> dict[str, int]:
        return dict(self._sending.flights.outcomes)

    @property
    def is_good(self) -> bool:
        """Whether at least one interface sent each message."""
        return self._sending.all_sent

    def octets(self, one: Pdu) -> bytes:
        """Return the PDU. Raises RequestError for a frame without one."""
        return _pdu(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        if not self._is_paced:
            self._sending.make_room()
        self._sending.depart(Payload(octets, "", one.origin), "", wishes(one))
        # Confirms are read here too, since a caller that never waits would lose some.
        self._sending.hear(time.monotonic())

    def wait(self, until: float) -> None:
        self._sending.hear(until)

    def finish(self) -> None:
        """Wait up to ANSWER_S for the last confirms."""
        self._sending.wait(client.ANSWER_S)

    def close(self) -> None:
        """Count the remaining unconfirmed messages as unconfirmed."""
        self._sending.give_up()

    def _over(self, flight: Flight) -> None:
        if flight.outcome != "sent":
            self.firsts.setdefault(count(self.fates, fate(flight)), flight.origin)


class Pull:
    """Sending end to a station's PULL socket, without confirms."""

    def __init__(self, context: client.Context, place: client.Address) -> None:
        self._pusher = client.push(context, place)

    def octets(self, one: Pdu) -> bytes:
        """Return the PDU. Raises RequestError for a frame without one."""
        return _pdu(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        """Send a message. Raises RequestError if the station accepts none for ANSWER_S."""
        if not self._pusher.poll(round(client.ANSWER_S * 1000), zmq.POLLOUT):
            raise RequestError(f"{one.origin}: the station takes no more", "see `captain status`")
        self._pusher.send_multipart([b"v2x.", octets, json.dumps(wishes(one)).encode()], zmq.DONTWAIT)

    def wait(self, until: float) -> None:
        _sleep(until)

    def close(self) -> None:
        self._pusher.close(linger=2000)


class Users:
    """Sending end to a station's SUB socket, as any user's program publishes to it, without answers.

    Raises StationError if the station does not subscribe within ANSWER_S.
    """

    def __init__(self, context: client.Context, place: client.Address) -> None:
        client.reach(place.host, place.from_users)
        # XPUB sends like PUB, and also tells when the station has subscribed; earlier messages would be lost.
        self._publisher = context.socket(zmq.XPUB)
        self._publisher.set(zmq.SNDHWM, 0)
        self._publisher.connect(place.url(place.from_users))
        if not self._publisher.poll(round(client.ANSWER_S * 1000)):
            raise StationError(f"{place.host}:{place.from_users}: no subscription from this port", client.START_ONE)

    def octets(self, one: Pdu) -> bytes:
        """Return the PDU. Raises RequestError for a frame without one."""
        return _pdu(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        self._publisher.send_multipart([b"v2x.", octets])

    def wait(self, until: float) -> None:
        _sleep(until)

    def close(self) -> None:
        """Close the socket; unsent messages have 2 s to leave."""
        self._publisher.close(linger=2000)


class Datagrams:
    """Sending end for UDP to one peer or multicast group.

    framing  framing of the `udp` interface there: ethernet, btp or pdu.
    unheard  number of datagrams that the peer's machine rejected because no program listens.

    Raises StationError without a route to the peer.
    """

    def __init__(self, to: Address, framing: str) -> None:
        self._unheard = 0
        self._framing = framing
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        try:
            self._socket.connect(to)
        except OSError as error:
            raise StationError(f"UDP to {to}: {error.strerror}", "check the routes: ip route") from error

    @property
    def unheard(self) -> int:
        # The rejection of the last datagram may not have been counted yet.
        if self._socket.fileno() >= 0 and self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self._unheard += 1
        return self._unheard

    def octets(self, one: Pdu) -> bytes:
        """Return the content of a datagram with this framing.

        Raises RequestError for a frame without a PDU, unless the framing is ethernet.
        """
        if self._framing == "ethernet":
            return _frame(one)
        pdu = _pdu(one)
        return pdu if self._framing == "pdu" else btp.encode(btp.BtpB(_port(one)), pdu)

    def send(self, octets: bytes, one: Pdu) -> None:
        """Send a datagram. Raises RequestError if the kernel refuses it."""
        # send() reports the rejection of an earlier datagram and sends nothing, so the second attempt sends this one.
        for _ in range(2):
            try:
                self._socket.send(octets)
            except ConnectionRefusedError:
                self._unheard += 1
            except OSError as error:
                raise RequestError(f"{one.origin}: UDP: {error.strerror}") from error
            else:
                return

    def wait(self, until: float) -> None:
        _sleep(until)

    def close(self) -> None:
        self._unheard = self.unheard
        self._socket.close()


class DeviceEnd:
    """Sending end for whole frames on a network device.

    Raises StationError if the device is missing or raw sockets are not permitted.
    """

    def __init__(self, name: str) -> None:
        self._socket = raw_socket(name, 0)  # EtherType 0: it receives nothing

    def octets(self, one: Pdu) -> bytes:
        return _frame(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        """Send a frame. Raises RequestError if the device refuses it."""
        try:
            self._socket.send(octets)
        except OSError as error:
            raise RequestError(f"{one.origin}: {error.strerror}") from error

    def wait(self, until: float) -> None:
        _sleep(until)

    def close(self) -> None:
        self._socket.close()


def station_lines(end: StationEnd) -> Iterator[str]:
    """Yield the outcomes of all messages given to a station, as text."""
    if end.outcomes:
        yield f"the station says: {', '.join(f'{times} {word}' for word, times in sorted(end.outcomes.items()))}"
    for why, times in sorted(end.fates.items()):
        yield f"not sent: {times}: {why} (first {end.firsts[why]})"


def unsent(end: End) -> StationError | None:
    """Return the first reason why an end did not send or deliver a message; None if it did or if this is unknown."""
    if isinstance(end, StationEnd) and not end.is_good:
        for why, where in end.firsts.items():
            return StationError(f"{where}: {why}")
        return StationError("the station did not confirm every message as sent")
    if isinstance(end, Datagrams) and end.unheard:
        return StationError(f"no receiver listened to {end.unheard} datagrams", "start the receiver first")
    return None


def raw_socket(device: str, ethertype: int) -> socket.socket:
    """Return a raw socket on a network device.

    Raises StationError if the device is missing or raw sockets are not permitted.
    """
    try:
        one = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        one.bind((device, ethertype))
    except PermissionError as error:
        raise not_permitted(device) from error
    except OSError as error:
        raise StationError(f"network device {device}: {error.strerror}", "`ip link` lists them") from error
    return one


def wishes(one: Pdu) -> Mapping[str, object]:
    """Return the options for a station's PULL socket with which a message leaves as it was recorded.

    These are BTP port, traffic class, area and hop limit, as far as the frame has them.
    """
    found: dict[str, object] = {} if one.port is None else {"btp_port": one.port}
    with suppress(ProtocolError):
        parts = ethernet.unwrap(one.frame)
        if isinstance(parts, ethernet.Ethernet) and parts.packet[0] & 15 == BasicNext.COMMON:
            packet = geonet_packet.parse(parts.packet)
            found["traffic_class"] = packet.common.traffic_class
            extended = packet.extended
            if isinstance(extended, GeoArea) and packet.common.header_type in GEO_BROADCASTS and extended.distance_a:
                found |= {"area": _area(packet.common.header_type, extended)}
                found["hop_limit"] = max(1, packet.common.max_hop_limit)
    return found


def _area(header_type: int, extended: GeoArea) -> dict[str, object]:
    shape = Shape(header_type - HeaderType.GBC_CIRCLE)
    found: dict[str, object] = {
        "shape": shape.name.lower(),
        "latitude": extended.latitude / 1e7,
        "longitude": extended.longitude / 1e7,
        "distance_a": extended.distance_a,
    }
    return found if shape is Shape.CIRCLE else found | {"distance_b": extended.distance_b, "angle": extended.angle}


def _pdu(one: Pdu) -> bytes:
    if not one.octets:
        raise RequestError(f"{one.origin}: a frame without a message: {one.carried}")
    return one.octets


def _frame(one: Pdu) -> bytes:
    if one.frame:
        return one.frame
    return framed(one._replace(octets=_pdu(one)))


def _port(one: Pdu) -> int:
    if one.port is not None:
        return one.port
    return int.from_bytes(framed(one)[-len(one.octets) - btp.SIZE :][:2])


def _sleep(until: float) -> None:
    time.sleep(max(0.0, until - time.monotonic()))  # this waits in the command's own process, not in a station's loop
