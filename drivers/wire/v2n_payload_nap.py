"""JSON of Vanetza-NAP: what it says of a message that it received, and a message that it is asked to send.

received   {"timestamp", "rssi", "stationID", ..., "fields": {"header": {...}, "cam": {...}}}
to send    the member `cam` alone, whose header is made here; or header and `cam`, as they are

Members and units: README and examples of nap-it/vanetza-nap.
"""

import contextlib
import json
import math
from collections.abc import Callable, Sequence
from itertools import takewhile
from typing import Any

from board.errors import RequestError
from drivers.reason import Reason
from drivers.wire.editions import of_header
from drivers.wire.v2n_message import Codec, Edition, RefusedError, Sending, message_id
from drivers.wire.v2n_payload_json import member, read_object, refuse, shown
from drivers.wire.v2n_payload_si import ConversionError, to_json
from drivers.wire.v2n_payload_si_read import from_json
from drivers.wire.v2n_type import Type

NOT_MEASURED_DBM = -1  # as in its examples
UNKNOWN_STATION_TYPE = 0
RELEASE_2 = frozenset((1, 2))  # messageID of DENM and CAM: out_*.json has the members' names of release 2, actionId
STATION_IDS = ("stationID", "stationId")  # in the header, by release; and beside the body, where the sender wants one


Note = Callable[[str], None]


def _ignore(text: str) -> None:
    """Nobody wants to know."""


class NapReceived:
    """The envelope around header and body.

    station  stationID of this one: who received.
    note     is called with what of a message was read in another unit, in words.
    """

    def __init__(self, station: int, codec: Codec, note: Note = _ignore) -> None:
        self._station = station
        self._codec = codec
        self._note = note

    def write(self, sending: Sending) -> bytes:
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
        envelope = read_object(payload)
        if envelope.get("receiverID") == self._station:
            raise RefusedError(Reason.OWN_ECHO, f"receiverID: {self._station} is this station")
        fields = member(envelope, "fields", dict)
        header = member(fields, "header", dict, "fields")

        def convert(edition: Edition, note: Note) -> Any:
            return from_json(edition.type_tree(), fields, "fields", note)

        return _encoded(self._codec, kind, header, convert, self._note), ""


class NapToSend:
    """The body, with a header of this station.

    station  stationID in headers that are made here.
    note     as NapReceived has it.
    """

    def __init__(self, station: int, codec: Codec, note: Note = _ignore) -> None:
        self._station = station
        self._codec = codec
        self._note = note

    def write(self, sending: Sending) -> bytes:
        edition, fields = _decoded(self._codec, sending)
        body = {name: value for name, value in fields.items() if name != "header"}
        whole = next(iter(body.values())) if len(body) == 1 else body
        if other := self._taken_for(edition, sending, whole):
            what = f"cannot send {edition.name} without its header: receivers would decode it as {other}"
            raise RequestError(f"{sending.kind}: {what}", 'use payload "nap" or octets')
        return _dump(whole)

    def _taken_for(self, edition: Edition, sending: Sending, body: dict[str, Any]) -> str:
        """The preferred edition of another protocolVersion that has the same names; empty: none."""
        editions = self._codec.editions(sending.kind)
        for other in _preferred(editions, edition):
            if set(other.versions) & set(edition.versions):
                continue
            with contextlib.suppress(ConversionError):
                self._value(other, editions, sending.kind, body, _ignore)
                return other.name
        return ""

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
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
    """protocolVersion, messageID and stationID as an edition's header calls them."""
    return [field.name for field in tree.fields[0].type.fields]


def _version(edition: Edition, editions: Sequence[Edition]) -> int:
    """The highest protocolVersion that makes receivers take it for this edition and no preferred one."""
    preferred = _preferred(editions, edition)
    own = [version for version in edition.versions if all(version not in one.versions for one in preferred)]
    return max(own or edition.versions)


def _preferred(editions: Sequence[Edition], edition: Edition) -> list[Edition]:
    """Those before an edition."""
    return list(takewhile(lambda one: one.name != edition.name, editions))


def _decoded(codec: Codec, sending: Sending) -> tuple[Edition, dict[str, Any]]:
    """Header and body as JSON, in the first edition that has a name for all of it. Raises RequestError.

    Of RELEASE_2 those of it come first: the editions read the same, and differ in the names.
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
    """The PDU, in the first edition that it fits. Raises RefusedError with what came closest to fit.

    header  of the JSON, which selects the editions; None: it has none. Then what has all names of an edition and a
            value out of its range is not tried with editions of other protocolVersions: the number has another meaning.
    """
    editions = codec.editions(kind)
    editions = of_header(editions, _numbers(header)) or editions
    if not editions:
        refuse("", f"{shown(kind)} is no type that the message library has")
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
        except ValueError as error:  # it has all names, and a value is out of range or missing
            why = str(error)
            named = named or set(edition.versions)
        if after > farthest:
            closest, farthest = f"{edition.name}: {why}", after
    raise RefusedError(Reason.PAYLOAD, closest)


def _numbers(header: object) -> bytes:
    """protocolVersion and messageID of a header in JSON, as in a PDU; empty: it has none that fit there."""
    if not isinstance(header, dict):
        return b""
    numbers = header.get("protocolVersion"), header.get("messageID", header.get("messageId"))
    return bytes(one for one in numbers if type(one) is int and 0 <= one <= 255)


def _dump(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "replace")
