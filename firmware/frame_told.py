"""A frame that was noted, as the report port tells it: topic, object, octets."""

import json
import struct
from dataclasses import dataclass
from functools import lru_cache

from board.time import TimeQuality
from drivers.message import ITS_HEADER, UNKNOWN_TIME, Confirm, Ego, Indication, MessageType
from drivers.reason import MEANING, Reason
from firmware import framing
from firmware.report import FRAME, digest_of, said_of


@dataclass(slots=True)
class Noted:
    """A frame, or a message without one, and what became of it.

    missed   of its interface, between the one before and this.
    frame    empty where one has to be made up.
    confirm  of what went out, or was to; a beacon has none.
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


class Told:
    """Numbers frames, those of each interface from 1 on.

    mac     the station's own, of what is made up to go out.
    totals  of each interface: frames that were told, and that were missed before these.
    """

    def __init__(self, mac: bytes) -> None:
        self._mac = mac
        self.totals: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._quality = UNKNOWN_TIME, json.dumps(said_of(UNKNOWN_TIME))

    def of(self, one: Noted, now_ns: int, ego: Ego) -> tuple[bytes, bytes, bytes]:
        """Topic, object and octets. The object is put together by hand: json.dumps() of it takes twice the time."""
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
            said += f', "implausible": "{", ".join(doubts)}"'  # a text: recorders take nothing deeper
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
        octets = one.frame or self._made_up(one, now_ns, ego)
        return b"%s%s." % (FRAME, interface.encode()), f"{said}}}".encode(), octets

    def _in_words(self, quality: TimeQuality) -> str:
        """As JSON; most frames have that of the one before."""
        if quality is not self._quality[0]:
            self._quality = quality, json.dumps(said_of(quality))
        return self._quality[1]

    def _made_up(self, one: Noted, now_ns: int, ego: Ego) -> bytes:
        try:
            if one.indication is not None:
                return framing.of_indication(one.indication, now_ns, ego)
            if one.confirm is not None:
                return framing.of_request(one.confirm.request, self._mac, ego)
        except struct.error:  # a number that no header has room for: the interface took it, a frame does not
            pass
        return framing.of_octets(one.pdu)


@lru_cache(maxsize=256)
def _quoted(text: str) -> str:
    return json.dumps(text)
