"""What there is to replay: whole frames of captures, broken ones and beacons among them, and PDUs of all the rest."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO, Literal

from board.errors import ProtocolError, RequestError
from drivers.wire import frame as ethernet
from drivers.wire.geonet_header import HeaderType
from firmware.codec import capture, layers
from firmware.codec.encoding import Wish, encode
from firmware.codec.library import load
from firmware.codec.pcapng import Direction
from firmware.codec.reading import Item, Object, Pdu, Reader, pdu_of, port_of, when_ns
from firmware.replay.reasons import count

_SINGLE_HOP = (HeaderType.SHB, HeaderType.BEACON)


@dataclass(frozen=True)
class Choice:
    """Which frames of recordings that say it.

    direction    that they had at the station which recorded them.
    interfaces   of that station, by name; all when empty.
    has_dropped  whether those as well that it did not pass on.
    """

    direction: Literal["in", "out", "both"] = "in"
    interfaces: frozenset[str] = frozenset()
    has_dropped: bool = True

    def refusal(self, one: capture.Frame) -> str:
        """What a frame is, which is not among them; empty where it is."""
        if self.interfaces and one.interface not in self.interfaces:
            return f"of interface {one.interface or '(no name)'}"
        if one.direction is Direction.OUT and self.direction == "in":
            return "that the station had sent"
        if one.direction is Direction.IN and self.direction == "out":
            return "that the station had received"
        reason = one.said.get("reason")
        return f"that the station did not pass on: {reason}" if reason and not self.has_dropped else ""


class Source(Reader):
    """As the codec reads it, but for captures, whose frames come without a message as well: then octets are empty."""

    def __init__(self, form: str | None, choice: Choice, standard_input: BinaryIO) -> None:
        super().__init__(form, standard_input)
        self._choice = choice

    def items(self, sources: Sequence[str]) -> Iterator[Pdu | RequestError]:
        """Everything, in the order of the files; what is wrong is one item like the rest."""
        for item in self.read(sources):
            try:
                yield _encoded(item) if isinstance(item, Object) else item
            except RequestError as error:
                yield error

    def frame(self, frame: capture.Frame, origin: str) -> Iterator[Item]:
        if refusal := self._choice.refusal(frame):
            count(self.skipped, f"frames {refusal}")
            return
        packet = layers.packet_of(frame.link, frame.octets)
        if isinstance(packet, layers.NoMessage):
            count(self.skipped, f"frames {packet.what}")
            return
        when = frame.when_ns or None  # 1970 is what is written where no time is known
        yield _opened(packet, origin, when)._replace(frame=_framed(frame, packet))


def _opened(packet: bytes, origin: str, when_ns: int | None) -> Pdu:
    try:
        found = layers.open_packet(packet)
    except ProtocolError as error:
        found = layers.NoMessage(f"broken: {error.message}")
    if isinstance(found, layers.NoMessage):
        return Pdu(b"", origin, None, when_ns, found.what)
    return Pdu(found.pdu, origin, found.btp_port, when_ns, str(found))


def _framed(frame: capture.Frame, packet: bytes) -> bytes:
    """The frame as it was; a new one around the packet where it came in another link layer, or in UDP."""
    if frame.link == capture.ETHERNET and frame.octets[ethernet.HEADER :] == packet:
        return frame.octets
    # The end of the GN address, in the source position vector behind basic and common header (and sequence number).
    at = 14 if packet[5:6] and packet[5] in _SINGLE_HOP else 18
    return ethernet.wrap(packet[at : at + 6].ljust(6, b"\0"), packet)


def _encoded(one: Object) -> Pdu:
    """Octets come before fields: they are exact. Raises RequestError."""
    if "hex" in one.value or "base64" in one.value:
        return pdu_of(one)
    known = sorted(load().all(), key=lambda message: (message.type, message.rank))
    octets = encode(one, Wish(known, None, known)).octets
    return Pdu(octets, one.origin, port_of(one), when_ns(one))
