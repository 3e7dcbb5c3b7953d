"""A profile at work: which topics and payloads a message becomes, and which message a delivery holds.

Sans I/O: a profile knows templates, forms of payloads and rules, and nothing of brokers.
"""

import re
from typing import NamedTuple

from board.errors import ConfigurationError
from drivers.message import ITS_HEADER, MAX_PDU, Ego
from drivers.reason import Reason
from drivers.wire.v2n_description import Form, ProfileDescription, Row, TypeRule
from drivers.wire.v2n_message import (
    MAX_PAYLOAD,
    Codec,
    Delivery,
    Identity,
    Payload,
    Publication,
    Received,
    RefusedError,
    Sending,
)
from drivers.wire.v2n_payload import Base64, Binary, VCaptain
from drivers.wire.v2n_topic import Template, check_value

__all__ = ["Codec", "Delivery", "Identity", "Profile", "Publication", "Received", "RefusedError"]

_NO_RULE = TypeRule()


class _Place(NamedTuple):
    """A row, ready for use."""

    template: Template
    payload: Payload
    types: frozenset[str]
    pattern: re.Pattern[str]

    def holds(self, kind: str) -> bool:
        return not self.types or kind in self.types


class Profile:
    """One profile of one station.

    codec  of the forms that need one (needs_codec).

    Raises ConfigurationError where the identity cannot stand in the profile's topics.
    """

    def __init__(self, description: ProfileDescription, identity: Identity, codec: Codec | None = None) -> None:
        self.description = description
        self.identity = identity
        self._codec = codec
        self._own = {
            "host": identity.host,
            "station": str(identity.station),
            "uuid": identity.uuid,
            "prefix": identity.prefix or description.prefix,
        }
        rows: tuple[Row, ...] = (*description.publish, *description.subscribe)
        for name in sorted({name for row in rows for name in Template(row.topic, True).variables} & set(self._own)):
            check_value(name, self._own[name])
        self._publish = [self._place(row) for row in description.publish]
        self._subscribe = [self._place(row) for row in description.subscribe]

    def publications(self, kind: str, btp_port: int, pdu: bytes, own: Ego, now_ms: int) -> list[Publication]:
        """What is published for a PDU.

        kind    name of its type; empty: its messageID names it.
        now_ms  Unix time.

        Raises RequestError where the profile cannot carry it.
        """
        kind = kind or str(pdu[1])
        rule = self.description.types.get(kind, _NO_RULE)
        qos = self.description.qos if rule.qos is None else rule.qos
        retain = self.description.retain if rule.retain is None else rule.retain
        expiry_s = self.description.expiry_s if rule.expiry_s is None else rule.expiry_s
        values = {**self._own, "type": rule.topic or kind, "port": str(btp_port)}
        sending = Sending(kind, btp_port, pdu, own, now_ms)
        return [
            Publication(place.template.fill(values), place.payload.write(sending), qos, retain, expiry_s)
            for place in self._publish
            if place.holds(kind)
        ]

    def subscriptions(self, own: Ego) -> frozenset[tuple[str, int]]:
        """Filters and their quality of service, for where the station is now."""
        qos = self.description.qos
        return frozenset((place.template.filter(self._own), qos) for place in self._subscribe)

    def receive(self, delivery: Delivery) -> Received:
        """The PDU of a delivery. Raises RefusedError."""
        topic, payload, is_retained, _ = delivery
        if len(payload) > MAX_PAYLOAD:
            raise RefusedError(Reason.PAYLOAD, f"{topic[:64]}: {len(payload)} octets are above {MAX_PAYLOAD}")
        place, found = self._find(topic)
        kind = found.get("type") or ""
        if is_retained and not self.description.types.get(kind, _NO_RULE).accept_retained:
            raise RefusedError(Reason.RETAINED, f"{topic[:64]}: the broker had kept it")
        port = _port(topic, found["port"]) if found.get("port") else None
        pdu, source = place.payload.read(kind, payload)
        _check_pdu(topic, pdu)
        return Received(pdu, port, source)

    def connected(self) -> Publication | None:
        """What the station says once it is connected."""
        return self._said(self.description.status.topic, self.description.status.connected)

    def closing(self) -> Publication | None:
        """What it says before it closes the connection."""
        return self._said(self.description.status.topic, self.description.status.closing)

    def lost(self) -> Publication | None:
        """The last will."""
        status = self.description.status
        return self._said(status.lost_topic or status.topic, status.lost)

    def _said(self, topic: str, text: str) -> Publication | None:
        if not topic or not text:
            return None
        status = self.description.status
        payload = Template(text).fill(self._own).encode()
        return Publication(Template(topic).fill(self._own), payload, status.qos, status.retain, None)

    def _find(self, topic: str) -> tuple[_Place, dict[str, str | None]]:
        for place in self._subscribe:
            match = place.pattern.fullmatch(topic)
            if match:
                return place, match.groupdict()
        known = ", ".join(row.topic for row in self.description.subscribe)
        raise RefusedError(Reason.TOPIC, f"topic {topic[:64]!r} is none of {known}")

    def _place(self, row: Row) -> _Place:
        template = Template(row.topic, is_filter=True)
        return _Place(template, self._form(row.payload), frozenset(row.types), template.pattern(self._own))

    def _form(self, form: Form) -> Payload:
        match form:
            case "vcaptain":
                return VCaptain(self.identity.host)
            case "binary":
                return Binary()
            case "base64":
                return Base64()
        raise ConfigurationError(f"profile {self.description.name}: payload {form!r} is not there")


def _port(topic: str, text: str) -> int:
    if not re.fullmatch("[0-9]{1,5}", text) or int(text) > 65535:
        raise RefusedError(Reason.TOPIC, f"topic {topic[:64]!r}: {text[:16]!r} is no BTP port")
    return int(text)


def _check_pdu(topic: str, pdu: bytes) -> None:
    size = len(pdu)
    if size >= ITS_HEADER and size <= MAX_PDU:
        return
    reason = Reason.EMPTY_PDU if not pdu else Reason.SHORT_PDU if size < ITS_HEADER else Reason.LONG_PDU
    raise RefusedError(reason, f"{topic[:64]}: a PDU of {size} octets; {ITS_HEADER} to {MAX_PDU} are possible")
