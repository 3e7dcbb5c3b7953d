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
from drivers.wire.v2n_message import Codec, Edition, RefusedError, Sending
from drivers.wire.v2n_payload_json import member, read_object, refuse, shown
from drivers.wire.v2n_payload_si import ConversionError, to_json
from drivers.wire.v2n_payload_si_read import from_json
from drivers.wire.v2n_type import Type

NOT_MEASURED_DBM = -1  # as in its examples
UNKNOWN_STATION_TYPE = 0
STATION_IDS = ("stationID", "stationId")  # in the header, by release; and beside the body, where the sender wants one


class NapReceived:
    """The envelope around header and body.

    station  stationID of this one: who received.
    """

    def __init__(self, station: int, codec: Codec) -> None:
        self._station = station
        self._codec = codec

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
        return _encoded(self._codec, kind, header, lambda edition: from_json(edition.type_tree(), fields, "fields")), ""


class NapToSend:
    """The body, with a header of this station.

    station  stationID in headers that are made here.
    """

    def __init__(self, station: int, codec: Codec) -> None:
        self._station = station
        self._codec = codec

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
                self._value(other, editions, sending.kind, body)
                return other.name
        return ""

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        given = read_object(payload)
        editions = self._codec.editions(kind)
        header = given.get("header")
        return _encoded(self._codec, kind, header, lambda edition: self._value(edition, editions, kind, given)), ""

    def _value(self, edition: Edition, editions: Sequence[Edition], kind: str, given: dict[str, Any]) -> Any:
        tree = edition.type_tree()
        if "header" in given:
            return from_json(tree, given, kind)
        body = {name: value for name, value in given.items() if name not in STATION_IDS}
        station = next((given[name] for name in STATION_IDS if name in given), self._station)
        components = [field.name for field in tree.fields if field.name != "header"]
        whole = {components[0]: body} if len(components) == 1 else body
        return from_json(tree, {"header": _header(tree, edition, editions, kind, station), **whole}, kind)


def _header(tree: Type, edition: Edition, editions: Sequence[Edition], kind: str, station: object) -> dict[str, Any]:
    number = int(kind) if kind.isdecimal() and int(kind) in edition.ids else edition.ids[0]
    version, message, sender = (field.name for field in tree.fields[0].type.fields)
    return {version: _version(edition, editions), message: number, sender: station}


def _version(edition: Edition, editions: Sequence[Edition]) -> int:
    """The highest protocolVersion that makes receivers take it for this edition and no preferred one."""
    preferred = _preferred(editions, edition)
    own = [version for version in edition.versions if all(version not in one.versions for one in preferred)]
    return max(own or edition.versions)


def _preferred(editions: Sequence[Edition], edition: Edition) -> list[Edition]:
    """Those before an edition."""
    return list(takewhile(lambda one: one.name != edition.name, editions))


def _decoded(codec: Codec, sending: Sending) -> tuple[Edition, dict[str, Any]]:
    """Header and body as JSON, in the first edition that has a name for all of it. Raises RequestError."""
    first: ValueError | None = None
    try:
        for edition, value in codec.decodings(sending.pdu):
            try:
                found: dict[str, Any] = to_json(edition.type_tree(), value, sending.kind)
            except ConversionError as error:
                first = first or error
            else:
                return edition, found
    except ValueError as error:
        first = first or error
    raise RequestError(f"{sending.kind} is not to be had as JSON: {first}") from first


def _encoded(codec: Codec, kind: str, header: object, convert: Callable[[Edition], Any]) -> bytes:
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
        try:
            value = convert(edition)
            pdu = edition.encode(value)
            if of_header([edition], pdu) or not of_header(editions, pdu):
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
