"""Input of a replay: frames of captures, and PDUs in all other formats."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO, Literal

from board.runtime.errors import ProtocolError, RequestError
from drivers.wire import frame as ethernet
from drivers.wire.geonet.header import HeaderType
from firmware.codec.encoding import Wish, pdu_from
from firmware.codec.library import load
from firmware.codec.reading import Item, Object, Pdu, Reader, pdu_of
from firmware.recordings import capture, layers
from firmware.recordings.pcapng import Direction
from firmware.replay.reasons import count

_SINGLE_HOP = (HeaderType.SHB, HeaderType.BEACON)


@dataclass(frozen=True)
class Choice:
    """Selection of a recording's frames; it needs a recording that contains these facts.

    direction    direction at the recording station.
    interfaces   names of that station's interfaces; empty: all.
    has_dropped  include frames that the station did not pass on.
    """

    direction: Literal["in", "out", "both"] = "in"
    interfaces: frozenset[str] = frozenset()
    has_dropped: bool = True

    def refusal(self, one: capture.Frame) -> str:
        """Return a description of a frame that is not selected; empty if it is selected."""
        if self.interfaces and one.interface not in self.interfaces:
            return f"of interface {one.interface or '(no name)'}"
        if one.direction is Direction.OUT and self.direction == "in":
            return "that the station had sent"
        if one.direction is Direction.IN and self.direction == "out":
            return "that the station had received"
        reason = one.said.get("reason")
        return f"that the station did not pass on: {reason}" if reason and not self.has_dropped else ""


class Source(Reader):
    """Reader of the codec's formats.

    Frames of captures are also read if they contain no message; their octets are empty.
    """

    def __init__(self, form: str | None, choice: Choice, standard_input: BinaryIO) -> None:
        super().__init__(form, standard_input)
        self._choice = choice

    def items(self, sources: Sequence[str]) -> Iterator[Pdu | RequestError]:
        """Yield all messages and frames in the order of the files; an error is yielded as an item."""
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
        when = frame.when_ns or None  # time 0 in a capture means that the time is unknown
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
    """Return the frame as it was recorded; a new Ethernet frame if the packet came in another link layer or in UDP."""
    if frame.link == capture.ETHERNET and frame.octets[ethernet.HEADER :] == packet:
        return frame.octets
    # Offset of the last 6 octets of the GN address, which are the MAC address. The source position vector follows the
    # basic header, the common header and, for other than single-hop packets, the sequence number.
    at = 14 if packet[5:6] and packet[5] in _SINGLE_HOP else 18
    return ethernet.wrap(packet[at : at + 6].ljust(6, b"\0"), packet)


def _encoded(one: Object) -> Pdu:
    """Return the PDU of a JSON object. Raises RequestError."""
    if "message" not in one.value:
        return pdu_of(one)
    known = sorted(load().all(), key=lambda message: (message.type, message.rank))
    return pdu_from(one, Wish(known, None, known))[0]
