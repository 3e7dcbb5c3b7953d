"""The JSON envelope of Orange's its-client 2.x around a PDU: message_format "asn1/uper".

Members and bounds: the schemas cam 2.4.0 and mcm 2.0.1 of its-client, which have this format; the same envelope carries
the other types. message_format "json/raw", a message as JSON with names of its own for each type, is neither written
nor read: what arrives in it is refused by that name.
"""

import binascii
import json
from collections.abc import Mapping
from typing import Any

from board.errors import RequestError
from drivers.reason import Reason
from drivers.wire.v2n_description import TypeRule
from drivers.wire.v2n_message import RefusedError, Sending, source_of
from drivers.wire.v2n_payload import from_base64
from drivers.wire.v2n_payload_json import member, read_object, refuse, shown

FORMAT = "asn1/uper"
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
        if sending.now_ms < FIRST_MS:
            raise RequestError(
                f"timestamp {sending.now_ms} is before 2018, and the profile's schema has none such",
                "set the clock: captain waits for GNSS or chrony",
            )
        rule = self._rules.get(sending.kind, _NO_RULE)
        envelope: dict[str, Any] = {
            "message_type": rule.topic or sending.kind,
            "message_format": FORMAT,
            "source_uuid": self._uuid,
            "timestamp": sending.now_ms,
            "version": rule.schema_version,
        }
        if rule.origin:
            envelope["origin"] = rule.origin
        coded = binascii.b2a_base64(sending.pdu, newline=False).decode()
        envelope["message"] = {"version": rule.standard, "payload": coded}
        return json.dumps(envelope, separators=(",", ":")).encode()

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        envelope = read_object(payload)
        source = member(envelope, "source_uuid", str)
        if source == self._uuid:
            raise RefusedError(Reason.OWN_ECHO, f"source_uuid: {source!r} is this station")
        named, expected = member(envelope, "message_type", str), self._name(kind)
        if expected and named != expected:
            refuse("message_type", f"{shown(named)} in a topic of {expected!r}")
        member(envelope, "version", str)
        timestamp = member(envelope, "timestamp", int)
        if not FIRST_MS <= timestamp <= LAST_MS:
            refuse("timestamp", f"{shown(timestamp)} is not in {FIRST_MS}..{LAST_MS}")
        form = envelope.get("message_format", "json/raw")  # as in schemas before asn1/uper
        if form != FORMAT:
            refuse("message_format", f'{shown(form)} is not read; the sender has to choose "{FORMAT}"')
        message = member(envelope, "message", dict)
        coded = member(message, "payload", str, "message")
        return from_base64(coded.encode("utf-8", "replace"), "message.payload"), source_of(source)

    def _name(self, kind: str) -> str:
        return self._rules.get(kind, _NO_RULE).topic or kind
