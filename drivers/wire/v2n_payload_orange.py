"""The JSON envelope of Orange's its-client 2.x around a PDU: message_format "asn1/uper", and for CAM "json/raw" too.

Members and bounds: the schemas cam 2.4.0 and mcm 2.0.1 of its-client, which have asn1/uper; the same envelope carries
the other types. json/raw is a message as JSON with names of its own for each type: what arrives in it and is not read
is refused by that name.
"""

import binascii
import json
from collections.abc import Mapping
from typing import Any

from board.errors import RequestError
from drivers.reason import Reason
from drivers.wire.v2n_description import TypeRule
from drivers.wire.v2n_message import Codec, RefusedError, Sending, source_of
from drivers.wire.v2n_payload import from_base64
from drivers.wire.v2n_payload_json import member, read_object, refuse, shown
from drivers.wire.v2n_payload_orange_raw import KINDS_OF_MESSAGES, from_raw, to_raw
from drivers.wire.v2n_payload_si import ConversionError

FORMAT, RAW = "asn1/uper", "json/raw"
FIRST_MS = 1_514_764_800_000  # 2018-01-01, the least timestamp of the schemas
LAST_MS = 1 << 42  # 2109. The schemas end in 2028, and a receiver has no use for that

_NO_RULE = TypeRule()


class Orange:
    """The envelope.

    uuid   of this station; what it sent itself is refused.
    rules  of types: schema_version, standard, origin.
    """

    def __init__(self, uuid: str, rules: Mapping[str, TypeRule]) -> None:
        self._uuid = uuid
        self._rules = rules

    def write(self, sending: Sending) -> bytes:
        coded = binascii.b2a_base64(sending.pdu, newline=False).decode()
        standard = self._rule(sending.kind).standard_of(sending.pdu[0])
        return self._envelope(sending, FORMAT, {"version": standard, "payload": coded})

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        envelope = read_object(payload)
        source = member(envelope, "source_uuid", str)
        if source == self._uuid:
            raise RefusedError(Reason.OWN_ECHO, f"source_uuid: {source!r} is this station")
        named, expected = member(envelope, "message_type", str), self._rule(kind).topic or kind
        if expected and named != expected:
            refuse("message_type", f"{shown(named)} in a topic of {expected!r}")
        member(envelope, "version", str)
        timestamp = member(envelope, "timestamp", int)
        if not FIRST_MS <= timestamp <= LAST_MS:
            refuse("timestamp", f"{shown(timestamp)} is not in {FIRST_MS}..{LAST_MS}")
        form = envelope.get("message_format", RAW)  # as in schemas before asn1/uper
        return self._pdu(kind, form, member(envelope, "message", dict)), source_of(source)

    def _envelope(self, sending: Sending, form: str, message: dict[str, Any]) -> bytes:
        if sending.now_ms < FIRST_MS:
            raise RequestError(
                f"timestamp {sending.now_ms} is before 2018, and the profile's schema has none such",
                "set the clock, or wait for the time of GNSS",
            )
        rule = self._rule(sending.kind)
        envelope: dict[str, Any] = {
            "message_type": rule.topic or sending.kind,
            "message_format": form,
            "source_uuid": self._uuid,
            "timestamp": sending.now_ms,
            "version": rule.schema_version,
        }
        if rule.origin:
            envelope["origin"] = rule.origin
        return json.dumps(envelope | {"message": message}, separators=(",", ":")).encode()

    def _pdu(self, kind: str, form: object, message: dict[str, Any]) -> bytes:
        if form != FORMAT:
            refuse("message_format", f'{shown(form)} is not read; the sender has to choose "{FORMAT}"')
        coded = member(message, "payload", str, "message")
        return from_base64(coded.encode("utf-8", "replace"), "message.payload")

    def _rule(self, kind: str) -> TypeRule:
        return self._rules.get(kind, _NO_RULE)


class OrangeRaw(Orange):
    """The envelope with CAMs as JSON; other types are read as in Orange, and not written."""

    def __init__(self, uuid: str, rules: Mapping[str, TypeRule], codec: Codec) -> None:
        super().__init__(uuid, rules)
        self._codec = codec

    def write(self, sending: Sending) -> bytes:
        if sending.kind not in KINDS_OF_MESSAGES:
            hint = 'give payload "orange" a row of its own, without these types'
            raise RequestError(f'{sending.kind}: "{RAW}" is written for {", ".join(KINDS_OF_MESSAGES)} only', hint)
        first: ValueError | None = None
        try:
            for edition, value in self._codec.decodings(sending.pdu):
                try:
                    return self._envelope(sending, RAW, to_raw(edition.type_tree(), value))
                except ConversionError as error:
                    first = first or error
        except ValueError as error:
            first = first or error
        raise RequestError(f'{sending.kind} is not to be had as "{RAW}": {first}') from first

    def _pdu(self, kind: str, form: object, message: dict[str, Any]) -> bytes:
        if form != RAW or kind not in KINDS_OF_MESSAGES:
            return super()._pdu(kind, form, message)
        version = member(message, "protocol_version", int, "message")
        editions = [edition for edition in self._codec.editions(kind) if version in edition.versions]
        first: ValueError | None = None
        for edition in editions:
            try:
                return edition.encode(from_raw(edition.type_tree(), edition.ids[0], message))
            except ValueError as error:
                first = first or error
        return refuse("", str(first)) if first else refuse("message.protocol_version", f"{version} is of no {kind}")
