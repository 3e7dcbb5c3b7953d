"""JSON envelope of Orange's its-client 2.x around a message, in message_format "json/raw" or "asn1/uper".

The station writes the newest schema of the type. It uses JSON if JSON can hold the whole message, because its-client
finds position and speed there. Otherwise it sends the PDU in base64, which the schemas of cam, mcm and poim allow. A
message that the schema of its type cannot hold is refused: a receiver that checks the schema would drop it. Types
without a schema are sent as PDUs in the same envelope. The station reads both formats, also of older schemas; schema
1.1.3 calls message_type type.

Members and bounds: schema/ of its-client (2026).
"""

import binascii
import json
from collections.abc import Mapping
from typing import Any

from board.runtime.errors import RequestError
from drivers.reason import Reason
from drivers.wire.editions import of_header
from drivers.wire.v2n.description import TypeRule
from drivers.wire.v2n.message import MAX_PAYLOAD, Codec, RefusedError, Sending, message_id, source_of
from drivers.wire.v2n.payload.json_values import member, read_object, refuse, shown
from drivers.wire.v2n.payload.orange.names import RAW
from drivers.wire.v2n.payload.orange.old import numbers, renewed
from drivers.wire.v2n.payload.orange.raw import to_raw
from drivers.wire.v2n.payload.orange.read import from_raw
from drivers.wire.v2n.payload.plain import from_base64
from drivers.wire.v2n.payload.si import ConversionError

UPER, JSON = "asn1/uper", "json/raw"
FIRST_MS = 1_514_764_800_000  # 2018-01-01, smallest timestamp of the schemas
LAST_MS = 1 << 42  # the year 2109. The limit of the schemas, 2028, is too early for a receiver

_NO_RULE = TypeRule()
# Types with a schema for JSON. The schemas of srem and ssem refer to a schema dsrc 1.0.0 that its-client lacks.
_HAS_JSON = frozenset({*RAW, "srem", "ssem"})
_NAMES_FORMAT = frozenset({"cam"})  # types of _HAS_JSON that also allow asn1/uper: their schema has message_format
_OLDEST_CPM = (2, 1)  # older schemas have the CPM of TR 103 562, with other names
_MESSAGE_TYPES = {"poi": "poi"}  # name in the envelope, if it differs from the name in the topic


class Orange:
    """Form of payloads with the JSON envelope.

    uuid   UUID of this station; its own messages are refused when they return.
    rules  rules of types: schema_version, standard, origin.
    codec  message library for JSON; None: only asn1/uper is written and read, and types with a JSON-only schema are
           refused.
    """

    def __init__(self, uuid: str, rules: Mapping[str, TypeRule], codec: Codec | None = None) -> None:
        self._uuid = uuid
        self._rules = rules
        self._codec = codec
        self._kinds = {rule.topic: kind for kind, rule in rules.items() if rule.topic}

    def write(self, sending: Sending) -> bytes:
        """Write a PDU as JSON, or in base64 if the profile has no JSON for it.

        Raises RequestError if the clock is before 2018, for a JSON-only type that cannot be converted, and above
        MAX_PAYLOAD.
        """
        if sending.kind in _HAS_JSON:
            try:
                return _bounded(sending.kind, self._json(sending))
            except RequestError:
                if sending.kind not in _NAMES_FORMAT:
                    raise
        coded = binascii.b2a_base64(sending.pdu, newline=False).decode()
        standard = self._rule(sending.kind).standard_of(sending.pdu[0])
        return self._envelope(sending, UPER, {"version": standard, "payload": coded})

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        """Return PDU and sender.

        Raises RefusedError for this station's own message, a type of another topic, a timestamp outside FIRST_MS to
        LAST_MS, and a member that is absent or invalid.
        """
        envelope = read_object(payload)
        source = member(envelope, "source_uuid", str)
        if source == self._uuid:
            raise RefusedError(Reason.OWN_ECHO, f"source_uuid: {source!r} is this station")
        named = member(
            envelope, "type" if "type" in envelope and "message_type" not in envelope else "message_type", str
        )
        expected = {self._rule(kind).topic or kind, kind}
        if kind and named not in expected:
            refuse("message_type", f"{shown(named)} in a topic of {self._rule(kind).topic or kind!r}")
        version = member(envelope, "version", str)
        timestamp = member(envelope, "timestamp", int)
        if not FIRST_MS <= timestamp <= LAST_MS:
            refuse("timestamp", f"{shown(timestamp)} is not in {FIRST_MS}..{LAST_MS}")
        form = envelope.get("message_format", JSON)  # older schemas have no message_format, only JSON
        message = member(envelope, "message", dict)
        return self._pdu(kind or self._kinds.get(named, named), form, version, message), source_of(source)

    def _json(self, sending: Sending) -> bytes:
        try:
            return self._envelope(sending, JSON, _raw(self._codec, sending))
        except ValueError as error:
            raise _unwritten(sending.kind, str(error)) from error

    def _envelope(self, sending: Sending, form: str, message: dict[str, Any]) -> bytes:
        if sending.now_ms < FIRST_MS:
            raise RequestError(
                f"timestamp {sending.now_ms} is before 2018, which the profile's schema does not allow",
                "set the clock, or wait for the time of GNSS",
            )
        rule = self._rule(sending.kind)
        envelope: dict[str, Any] = {
            "message_type": _MESSAGE_TYPES.get(sending.kind) or rule.topic or sending.kind,
            "message_format": form,
            "source_uuid": self._uuid,
            "timestamp": sending.now_ms,
            "version": rule.schema_version,
        }
        if form == JSON and sending.kind not in _NAMES_FORMAT:
            del envelope["message_format"]
        if rule.origin:
            envelope["origin"] = rule.origin
        return json.dumps(envelope | {"message": message}, separators=(",", ":")).encode()

    def _pdu(self, kind: str, form: object, version: str, message: dict[str, Any]) -> bytes:
        if form == JSON and self._codec:
            return _encoded(self._codec, kind, version, message)
        if form != UPER:
            refuse("message_format", f'{shown(form)} is not read; the sender has to choose "{UPER}"')
        coded = member(message, "payload", str, "message")
        return from_base64(coded.encode("utf-8", "replace"), "message.payload")

    def _rule(self, kind: str) -> TypeRule:
        return self._rules.get(kind, _NO_RULE)


class OrangeRaw(Orange):
    """Form of payloads that writes messages only as JSON; it reads the same as Orange."""

    def write(self, sending: Sending) -> bytes:
        """Write a PDU as JSON. Raises RequestError for a type not in RAW, or one that cannot be converted."""
        if sending.kind not in RAW:
            hint = 'give payload "orange" a row of its own, without these types'
            raise RequestError(f'{sending.kind}: "{JSON}" is written for {", ".join(RAW)} only', hint)
        return self._json(sending)


def _unwritten(kind: str, why: str) -> RequestError:
    hint = 'add a row [[publish]] with another payload, such as "binary", to the profile'
    return RequestError(f'{kind}: cannot be written as "{JSON}": {why}', hint)


def _bounded(kind: str, payload: bytes) -> bytes:
    if len(payload) > MAX_PAYLOAD:
        raise _unwritten(kind, f"{len(payload)} octets; at most {MAX_PAYLOAD}")
    return payload


def _raw(codec: Codec | None, sending: Sending) -> dict[str, Any]:
    """Return a message as JSON, from the first edition that is converted completely. Raises ValueError without one."""
    if sending.kind not in RAW:
        raise ValueError(f"the schema of {sending.kind} refers to a schema that its-client does not have")
    if codec is None:
        raise ValueError("it needs the message library")
    first: ValueError | None = None
    for edition, value in codec.decodings(sending.pdu):
        if not of_header([edition], sending.pdu):
            continue  # receivers of JSON select the edition by protocol_version
        try:
            return to_raw(sending.kind, edition.type_tree(), value)
        except ConversionError as error:
            first = first or error
    raise first or ValueError("no edition reads it")


def _encoded(codec: Codec, kind: str, version: str, message: dict[str, Any]) -> bytes:
    """Return the PDU in the first edition that the JSON fits, of the editions with its protocol_version.

    Raises RefusedError if no edition fits.
    """
    if kind not in RAW:
        refuse("message_format", f'"{JSON}" of {shown(kind)} is not read; the sender has to choose "{UPER}"')
    if kind == "cpm" and numbers(version) < _OLDEST_CPM:
        refuse("version", f"{shown(version)}: the JSON of a cpm is supported from version 2.1.0 on")
    number = member(message, "protocol_version", int, "message")
    last: ValueError | None = None
    for edition in codec.editions(kind):
        if number not in edition.versions:
            continue
        try:
            value = from_raw(
                kind, edition.type_tree(), message_id(codec, edition, kind), renewed(kind, version, message)
            )
            pdu = edition.encode(value)
        except ValueError as error:
            last = error
        else:
            if of_header([edition], pdu):
                return pdu
    if last:
        raise RefusedError(Reason.PAYLOAD, str(last)) from last
    return refuse("message.protocol_version", f"{number}: no edition of {kind} has this protocolVersion")
