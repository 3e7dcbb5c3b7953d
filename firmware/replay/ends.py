"""Where replayed frames and messages go: a station's endpoint, UDP datagrams, a network device."""

import json
import socket
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Protocol

import zmq

from board.address import Address
from board.errors import ProtocolError, RequestError, StationError
from drivers.intake import not_permitted
from drivers.message import Shape
from drivers.wire import btp, geonet_packet
from drivers.wire import frame as ethernet
from drivers.wire.geonet_header import BasicNext, HeaderType
from drivers.wire.geonet_packet import GeoArea
from firmware.codec.reading import Pdu
from firmware.codec.writing import framed
from firmware.replay.reasons import count
from firmware.user import client, sending
from firmware.user.account import fate
from firmware.user.flights import Flight
from firmware.user.payload import Payload

SEND_BUFFER = 1 << 20  # octets: a burst at full speed waits in the kernel
GEO_BROADCASTS = range(HeaderType.GBC_CIRCLE, HeaderType.GBC_ELLIPSE + 1)


class End(Protocol):
    """One way out."""

    def octets(self, one: Pdu) -> bytes:
        """What of it goes this way. Raises RequestError where nothing of it can."""

    def send(self, octets: bytes, one: Pdu) -> None:
        """These octets, whatever has become of them since. Raises RequestError where they cannot go."""

    def wait(self, until: float) -> None:
        """Until then on the monotonic clock, or until something has come back."""


class Station:
    """The PULL of a station, which confirms each message.

    fates     of those that no interface has sent, by why. firsts: where the first of each stood.
    is_paced  somebody else says when the next goes; otherwise so many are on their way at once.

    Raises StationError where none is, and where one takes or confirms nothing any more.
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
        """Whether each was sent by an interface at least."""
        return self._sending.all_sent

    def octets(self, one: Pdu) -> bytes:
        return _pdu(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        if not self._is_paced:
            self._sending.make_room()
        self._sending.depart(Payload(octets, "", one.origin), "", wishes(one))
        self._sending.hear(time.monotonic())  # also where nobody ever waits: else some would be lost

    def wait(self, until: float) -> None:
        self._sending.hear(until)

    def finish(self) -> None:
        """Wait a little for the last confirms."""
        self._sending.wait(client.ANSWER_S)

    def close(self) -> None:
        """What is not confirmed by now stays so."""
        self._sending.give_up()

    def _over(self, flight: Flight) -> None:
        if flight.outcome != "sent":
            self.firsts.setdefault(count(self.fates, fate(flight)), flight.origin)


class Pull:
    """The PULL of a station, which says nothing of it: what it does not take within a while is refused here."""

    def __init__(self, context: client.Context, place: client.Address) -> None:
        self._pusher = client.push(context, place)

    def octets(self, one: Pdu) -> bytes:
        return _pdu(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        if not self._pusher.poll(round(client.ANSWER_S * 1000), zmq.POLLOUT):
            raise RequestError(f"{one.origin}: the station takes no more", "see `captain status`")
        self._pusher.send_multipart([b"v2x.", octets, json.dumps(wishes(one)).encode()], zmq.DONTWAIT)

    def wait(self, until: float) -> None:
        _sleep(until)

    def close(self) -> None:
        self._pusher.close(linger=2000)


class Users:
    """The SUB of a station, as any user's program publishes to it. Nothing comes back."""

    def __init__(self, context: client.Context, place: client.Address) -> None:
        client.reach(place.host, place.from_users)
        # On the wire an XPUB is a PUB; it also tells when the station has subscribed, before which all is lost.
        self._publisher = context.socket(zmq.XPUB)
        self._publisher.set(zmq.SNDHWM, 0)
        self._publisher.connect(place.url(place.from_users))
        if not self._publisher.poll(round(client.ANSWER_S * 1000)):
            raise StationError(f"what listens at {place.host}:{place.from_users} does not subscribe", client.START_ONE)

    def octets(self, one: Pdu) -> bytes:
        return _pdu(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        self._publisher.send_multipart([b"v2x.", octets])

    def wait(self, until: float) -> None:
        _sleep(until)

    def close(self) -> None:
        """Wait a little for what is not sent yet."""
        self._publisher.close(linger=2000)


class Datagrams:
    """UDP to one peer or group. unheard counts those where the peer said that nobody listens.

    framing  of the station's `udp` interface there: ethernet, btp or pdu.
    """

    def __init__(self, to: Address, framing: str) -> None:
        self._unheard = 0
        self._framing = framing
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        try:
            self._socket.connect(to)
        except OSError as error:
            raise StationError(f"UDP to {to}: {error.strerror}", "is there a route?") from error

    @property
    def unheard(self) -> int:
        # Of the last one nothing has said it yet.
        if self._socket.fileno() >= 0 and self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self._unheard += 1
        return self._unheard

    def octets(self, one: Pdu) -> bytes:
        if self._framing == "ethernet":
            return _frame(one)
        pdu = _pdu(one)
        return pdu if self._framing == "pdu" else btp.encode(btp.BtpB(_port(one)), pdu)

    def send(self, octets: bytes, one: Pdu) -> None:
        # What an earlier datagram met is told now: this one has not left yet.
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


class Device:
    """Whole frames on a network device. Raises StationError where it is not there, or raw sockets are not permitted."""

    def __init__(self, name: str) -> None:
        self._socket = raw_socket(name, 0)  # it takes nothing

    def octets(self, one: Pdu) -> bytes:
        return _frame(one)

    def send(self, octets: bytes, one: Pdu) -> None:
        try:
            self._socket.send(octets)
        except OSError as error:
            raise RequestError(f"{one.origin}: {error.strerror}") from error

    def wait(self, until: float) -> None:
        _sleep(until)

    def close(self) -> None:
        self._socket.close()


def station_lines(end: Station) -> Iterator[str]:
    """What a station says of all that it was given."""
    if end.outcomes:
        yield f"the station says: {', '.join(f'{times} {word}' for word, times in sorted(end.outcomes.items()))}"
    for why, times in sorted(end.fates.items()):
        yield f"not sent: {times}: {why} (first {end.firsts[why]})"


def raw_socket(device: str, ethertype: int) -> socket.socket:
    """A socket of whole frames on a device. Raises StationError that says what is missing."""
    try:
        one = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        one.bind((device, ethertype))
    except PermissionError as error:
        raise not_permitted(device) from error
    except OSError as error:
        raise StationError(f"network device {device}: {error.strerror}", "`ip link` lists them") from error
    return one


def wishes(one: Pdu) -> Mapping[str, object]:
    """What a user who sends it anew asks for, so that it leaves as it came: options of the station's PULL."""
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
    time.sleep(max(0.0, until - time.monotonic()))  # a command's own process, no station's loop
