"""Frame report: topic, JSON object and octets of one frame for the report port."""

import json
import struct
from dataclasses import dataclass
from functools import lru_cache

from board.time.scales import TimeQuality
from drivers.message import ITS_HEADER, UNKNOWN_TIME, Confirm, Ego, Indication, MessageType
from drivers.reason import MEANING, Reason
from firmware.endpoint import framing
from firmware.endpoint.report import FRAME, digest_of, said_of


@dataclass(slots=True)
class Noted:
    """A frame that waits for its report, with its message and the outcome.

    missed      number of frames of this interface without a report since the previous one.
    when_ns     Unix time in ns.
    frame       octets of the frame; empty if the interface has none and one must be constructed.
    pdu         octets of the PDU; empty for a frame without one, such as a beacon.
    is_out      True for a frame that leaves.
    indication  the received message; None for a frame that leaves or was dropped early.
    confirm     outcome of a request; None for a received frame or a beacon.
    reason      drop reason; None if the frame was not dropped.
    """

    interface: str
    missed: int
    when_ns: int
    quality: TimeQuality
    frame: bytes
    pdu: bytes
    is_out: bool = False
    indication: Indication | None = None
    confirm: Confirm | None = None
    reason: Reason | None = None
    detail: str = ""

    @property
    def kind(self) -> MessageType | None:
        if self.indication is not None:
            return self.indication.kind
        return None if self.confirm is None else self.confirm.request.kind


class FrameReport:
    """Builds the frame reports and numbers them, those of each interface from 1.

    mac     MAC address of the station; source address of constructed frames that leave.
    totals  number of reported and missed frames by interface.
    """

    def __init__(self, mac: bytes) -> None:
        self._mac = mac
        self.totals: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._quality = UNKNOWN_TIME, json.dumps(said_of(UNKNOWN_TIME))

    def of(self, one: Noted, now_ns: int, ego: Ego) -> tuple[bytes, bytes, bytes]:
        """Return topic, JSON object and octets of a frame report.

        The JSON text is concatenated here, because json.dumps() takes twice the time.

        sequence    number of this report among those of its interface, from 1.
        missed      number of frames of this interface without a report since the previous report.
        total       number of frames of this interface so far, reported and missed.
        interface   interface of the frame.
        direction   `in` or `out`.
        when_ns     Unix time in ns at which the frame arrived or left.
        quality     quality of `when_ns`.
        is_made_up  true if the interface has no frames and this one was constructed around the PDU.
        type        message type of the PDU; absent with the next three for a frame without a PDU.
        message_id  messageID of the PDU; null if the PDU is too short.
        station_id  stationID of the PDU; null if the PDU is shorter than its header.
        digest      first 16 hexadecimal digits of the PDU's SHA-256.
        rssi_dbm    signal strength in dBm of a received frame; absent if unknown.
        implausible  reasons why the message is implausible, separated by `, `; absent for a plausible message.
        request     number of the request that the frame carries; absent with the next two for a received frame.
        queue_us    microseconds from the acceptance of the request until the driver got it.
        send_us     microseconds from then until the request had left.
        reason      drop reason; absent with the next two if the frame was not dropped.
        meaning     meaning of the reason.
        detail      cause of this drop, if known.
        """
        interface, kind, confirm = one.interface, one.kind, one.confirm
        self._sequence[interface] = sequence = self._sequence.get(interface, 0) + 1
        self.totals[interface] = total = self.totals.get(interface, 0) + 1 + one.missed
        said = (
            f'{{"sequence": {sequence}, "missed": {one.missed}, "total": {total}, "interface": {_quoted(interface)}, '
            f'"direction": "{"out" if one.is_out else "in"}", "when_ns": {one.when_ns}, '
            f'"quality": {self._in_words(one.quality)}, "is_made_up": {"false" if one.frame else "true"}'
        )
        if kind is not None:
            pdu = one.pdu
            station_id = int.from_bytes(pdu[2:ITS_HEADER], "big") if len(pdu) >= ITS_HEADER else "null"
            said += (
                f', "type": {_quoted(kind.name)}, "message_id": {pdu[1] if len(pdu) > 1 else "null"}, '
                f'"station_id": {station_id}, "digest": "{digest_of(pdu)}"'
            )
        if one.indication is not None and one.indication.rx.rssi_dbm is not None:
            said += f', "rssi_dbm": {one.indication.rx.rssi_dbm}'
        if one.indication is not None and (doubts := one.indication.rx.implausible):
            said += f', "implausible": "{", ".join(doubts)}"'  # as text, because recorders accept no nested values here
        if confirm is not None:
            said += (
                f', "request": {confirm.request.number}, "queue_us": {confirm.queue_s * 1e6:.1f}, '
                f'"send_us": {confirm.send_s * 1e6:.1f}'
            )
        if one.reason is not None:
            said += (
                f', "reason": "{one.reason}", "meaning": {_quoted(MEANING[one.reason])}, '
                f'"detail": {json.dumps(one.detail)}'
            )
        octets = one.frame or self._reconstructed(one, now_ns, ego)
        return b"%s%s." % (FRAME, interface.encode()), f"{said}}}".encode(), octets

    def _in_words(self, quality: TimeQuality) -> str:
        """Return the quality as JSON, cached: most frames have the same quality as the previous one."""
        if quality is not self._quality[0]:
            self._quality = quality, json.dumps(said_of(quality))
        return self._quality[1]

    def _reconstructed(self, one: Noted, now_ns: int, ego: Ego) -> bytes:
        try:
            if one.indication is not None:
                return framing.of_indication(one.indication, now_ns, ego)
            if one.confirm is not None:
                return framing.of_request(one.confirm.request, self._mac, ego)
        # The interface accepted a request with a value that is out of range for the GeoNetworking header.
        except struct.error:
            pass
        return framing.of_octets(one.pdu)


@lru_cache(maxsize=256)
def _quoted(text: str) -> str:
    return json.dumps(text)
