"""JSON of Vanetza-NAP: messages that it has received, and messages that it shall send.

received   {"timestamp", "rssi", "stationID", ..., "fields": {"header": {...}, "cam": {...}}}
to send    the member `cam` alone, for which this module makes the header; or header and `cam`, unchanged

Members and units: README and examples of nap-it/vanetza-nap.
"""

import contextlib
import json
import math
from collections.abc import Callable, Sequence
from itertools import takewhile
from typing import Any

from board.runtime.errors import RequestError
from drivers.reason import Reason
from drivers.wire.editions import of_header
from drivers.wire.type_tree import Type
from drivers.wire.v2n.message import Codec, Edition, RefusedError, Sending, message_id
from drivers.wire.v2n.payload.json_values import member, read_object, refuse, shown
from drivers.wire.v2n.payload.si import ConversionError, to_json
from drivers.wire.v2n.payload.si_read import from_json

NOT_MEASURED_DBM = -1  # as in the examples of Vanetza-NAP
UNKNOWN_STATION_TYPE = 0
RELEASE_2 = frozenset((1, 2))  # messageID of DENM and CAM: out_*.json has names of release 2, such as actionId
STATION_IDS = ("stationID", "stationId")  # name in the header, by release; the sender may also give it beside the body


Note = Callable[[str], None]


def _ignore(text: str) -> None:
    """Ignore a note."""


class NapReceived:
    """Form of a received message: an envelope around header and body.

    station  stationID of this station, the receiver in the envelope.
    note     called with a text if a value of a message was in another unit.
    """

    def __init__(self, station: int, codec: Codec, note: Note = _ignore) -> None:
        self._station = station
        self._codec = codec
        self._note = note

    def write(self, sending: Sending) -> bytes:
        """Write a PDU as the JSON of a received message.

        Raises RequestError if no edition decodes the PDU and has a name for every value.
        """
        _, fields = _decoded(self._codec, sending)
        header = fields["header"]
        return _dump(
            {
                "timestamp": sending.now_ms / 1000,
                "rssi": NOT_MEASURED_DBM,
                "stationID": next(header[name] for name in STATION_IDS if name in header),
                "stationAddr": "",
                "receiverID": self._station,
                "receiverType": UNKNOWN_STATION_TYPE,
                "packet_size": len(sending.pdu),
                "fields": fields,
            }
        )

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        """Return PDU and an empty source.

        Raises RefusedError for this station's own message, and for JSON that fits no edition.
        """
        envelope = read_object(payload)
        if envelope.get("receiverID") == self._station:
            raise RefusedError(Reason.OWN_ECHO, f"receiverID: {self._station} is this station")
        fields = member(envelope, "fields", dict)
        header = member(fields, "header", dict, "fields")

        def convert(edition: Edition, note: Note) -> Any:
            return from_json(edition.type_tree(), fields, "fields", note)

        return _encoded(self._codec, kind, header, convert, self._note), ""


class NapToSend:
    """Form of a message to send: its body, for which the reader makes a header.

    station  stationID in headers that are made here.
    note     called with a text if a value of a message was in another unit.
    """

    def __init__(self, station: int, codec: Codec, note: Note = _ignore) -> None:
        self._station = station
        self._codec = codec
        self._note = note

    def write(self, sending: Sending) -> bytes:
        """Write a PDU's body as JSON.

        Raises RequestError if no edition decodes the PDU, and if receivers would take the body without header for
        another message.
        """
        edition, fields = _decoded(self._codec, sending)
        body = {name: value for name, value in fields.items() if name != "header"}
        whole = next(iter(body.values())) if len(body) == 1 else body
        if other := self._taken_for(edition, sending, whole):
            what = f"cannot send {edition.name} without its header: receivers would decode it as {other}"
            raise RequestError(f"{sending.kind}: {what}", 'use payload "nap" or octets')
        return _dump(whole)

    def _taken_for(self, edition: Edition, sending: Sending, body: dict[str, Any]) -> str:
        """Return a preferred edition of another protocolVersion that accepts the same JSON; empty without one."""
        editions = self._codec.editions(sending.kind)
        for other in _preferred(editions, edition):
            if set(other.versions) & set(edition.versions):
                continue
            with contextlib.suppress(ConversionError):
                self._value(other, editions, sending.kind, body, _ignore)
                return other.name
        return ""

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        """Return the PDU, and an empty source. Raises RefusedError for JSON that fits no edition."""
        given = read_object(payload)
        editions = self._codec.editions(kind)

        def convert(edition: Edition, note: Note) -> Any:
            return self._value(edition, editions, kind, given, note)

        return _encoded(self._codec, kind, given.get("header"), convert, self._note), ""

    def _value(
        self, edition: Edition, editions: Sequence[Edition], kind: str, given: dict[str, Any], note: Note
    ) -> Any:
        tree = edition.type_tree()
        if "header" in given:
            return from_json(tree, given, kind, note)
        body = {name: value for name, value in given.items() if name not in STATION_IDS}
        station = next((given[name] for name in STATION_IDS if name in given), self._station)
        components = [field.name for field in tree.fields if field.name != "header"]
        whole = {components[0]: body} if len(components) == 1 else body
        numbers = _version(edition, editions), message_id(self._codec, edition, kind)
        return from_json(
            tree, {"header": dict(zip(_names(tree), (*numbers, station), strict=True)), **whole}, kind, note
        )


def _names(tree: Type) -> list[str]:
    """Return the names of protocolVersion, messageID and stationID in an edition's header."""
    return [field.name for field in tree.fields[0].type.fields]


def _version(edition: Edition, editions: Sequence[Edition]) -> int:
    """Return the highest protocolVersion by which receivers recognise this edition and not a preferred one."""
    preferred = _preferred(editions, edition)
    own = [version for version in edition.versions if all(version not in one.versions for one in preferred)]
    return max(own or edition.versions)


def _preferred(editions: Sequence[Edition], edition: Edition) -> list[Edition]:
    """Return the editions before an edition in the order of preference."""
    return list(takewhile(lambda one: one.name != edition.name, editions))


def _decoded(codec: Codec, sending: Sending) -> tuple[Edition, dict[str, Any]]:
    """Return header and body as JSON, from the first edition that has a name for every value.

    For the messageIDs of RELEASE_2, editions of release 2 come first: all decode the same values, with different names.
    Raises RequestError if no edition decodes the PDU or has all names.
    """
    first: ValueError | None = None
    try:
        found = list(codec.decodings(sending.pdu))
        if sending.pdu[1] in RELEASE_2:
            found.sort(key=lambda one: "messageId" not in _names(one[0].type_tree()))
        for edition, value in found:
            try:
                fields: dict[str, Any] = to_json(edition.type_tree(), value, sending.kind)
            except ConversionError as error:
                first = first or error
            else:
                return edition, fields
    except ValueError as error:
        first = first or error
    raise RequestError(f"{sending.kind}: cannot be written as JSON: {first}") from first


def _encoded(codec: Codec, kind: str, header: object, convert: Callable[[Edition, Note], Any], note: Note) -> bytes:
    """Return the PDU in the first edition that the JSON fits.

    header  header in the JSON, which selects the editions; None without one. In that case, if the JSON has all names of
            an edition but a value out of range, editions of other protocolVersions are not tried: the value has another
            meaning in them.

    Raises RefusedError with the error of the closest edition.
    """
    editions = codec.editions(kind)
    editions = of_header(editions, _numbers(header)) or editions
    if not editions:
        refuse("", f"type without a codec in the message library: {shown(kind)}")
    closest, farthest = "", -2.0
    named: set[int] = set()
    for edition in editions:
        if named and not named & set(edition.versions):
            continue
        after = math.inf
        notes: list[str] = []
        try:
            value = convert(edition, notes.append)
            pdu = edition.encode(value)
            if of_header([edition], pdu) or not of_header(editions, pdu):
                if notes:
                    note(f"{notes[0]}; {len(notes) - 1} more" if len(notes) > 1 else notes[0])
                return pdu
            why, after = f"header: protocolVersion {pdu[0]} is not of this edition", -1.0
        except ConversionError as error:
            why, after = str(error), error.after
        except ValueError as error:  # all names are known, but a value is out of range or missing
            why = str(error)
            named = named or set(edition.versions)
        if after > farthest:
            closest, farthest = f"{edition.name}: {why}", after
    raise RefusedError(Reason.PAYLOAD, closest)


def _numbers(header: object) -> bytes:
    """Return protocolVersion and messageID of a header in JSON, as octets of a PDU; empty if invalid."""
    if not isinstance(header, dict):
        return b""
    numbers = header.get("protocolVersion"), header.get("messageID", header.get("messageId"))
    return bytes(one for one in numbers if type(one) is int and 0 <= one <= 255)


def _dump(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "replace")
