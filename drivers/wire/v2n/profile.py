"""Profile in operation: converts messages to topics and payloads, and deliveries to messages.

It does no I/O: it uses templates, forms of payloads and rules, and does not talk to brokers.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

from board.runtime.errors import ConfigurationError, RequestError
from drivers.message import ITS_HEADER, MAX_PDU, Ego
from drivers.reason import Reason
from drivers.wire.quadkey import Tile, follow, from_digits, tile
from drivers.wire.v2n.description import Form, ProfileDescription, TopicRow, TypeRule
from drivers.wire.v2n.message import (
    MAX_PAYLOAD,
    Codec,
    Delivery,
    Identity,
    Payload,
    Publication,
    ReceivedPdu,
    RefusedError,
    Sending,
)
from drivers.wire.v2n.payload.nap import NapReceived, NapToSend
from drivers.wire.v2n.payload.orange.envelope import Orange, OrangeRaw
from drivers.wire.v2n.payload.plain import Base64, Binary, VCaptain
from drivers.wire.v2n.topic import Template, check_value, fill_text

__all__ = ["Codec", "Delivery", "Identity", "Profile", "Publication", "ReceivedPdu", "RefusedError"]

_NO_RULE = TypeRule()
_MAX_TOPIC = 1024  # characters; with two variables in one level, the time to match is the square of the length
_SLOWER = 0.9  # share of a limit of speeds_m_s: below it, tiles become smaller again (hysteresis)


class _Place(NamedTuple):
    """Prepared row of the profile."""

    template: Template
    form: Form
    payload: Payload
    types: tuple[str, ...]
    pattern: re.Pattern[str]

    def holds(self, kind: str) -> bool:
        return not self.types or kind in self.types


class Profile:
    """Profile of one station.

    codec  message library, for a description that needs_codec or may_decode.

    Raises ConfigurationError if the identity is invalid in the profile's topics or payloads.
    """

    def __init__(self, description: ProfileDescription, identity: Identity, codec: Codec | None = None) -> None:
        self.description = description
        self.identity = identity
        self.missing = ""  # why some rows did not publish the last message; empty if all did
        self.noted = ""  # which value of the last delivery was in another unit; empty: none
        self._codec = codec
        self._own = {
            "host": identity.host,
            "station": str(identity.station),
            "uuid": identity.uuid,
            "prefix": identity.prefix or description.prefix,
        }
        self._check_identity()
        self._kinds = {rule.topic: kind for kind, rule in description.types.items() if rule.topic}
        self._publish = [self._place(row) for row in description.publish]
        self._subscribe = [self._place(row) for row in description.subscribe]
        self._centre: Tile | None = None
        self._larger = 0  # levels by which tiles are larger because of the speed

    @property
    def moves(self) -> bool:
        """True if the subscriptions depend on the station's position."""
        return any(place.template.needs("quadkey") for place in self._subscribe)

    def publications(self, kind: str, btp_port: int, pdu: bytes, own: Ego, now_ms: int) -> list[Publication]:
        """Return the publications for a PDU.

        kind    name of its type; empty: the PDU's messageID is used.
        now_ms  Unix time.

        Raises RequestError if the profile cannot publish the PDU. If only some rows cannot, `missing` gives the cause.
        """
        kind = kind or str(pdu[1])
        rule = self._rule(kind)
        qos = self.description.qos if rule.qos is None else rule.qos
        retain = self.description.retain if rule.retain is None else rule.retain
        expiry_s = self.description.expiry_s if rule.expiry_s is None else rule.expiry_s
        values = {**self._own, "type": rule.topic or kind, "port": str(btp_port)}
        sending = Sending(kind, btp_port, pdu, own, now_ms)
        written: dict[Form, bytes] = {}
        failed: RequestError | None = None
        found = []
        for place in self._publish:
            if not place.holds(kind):
                continue
            try:
                if place.template.needs("quadkey"):
                    values["quadkey"] = "/".join(self._own_tile(own))
                if place.form not in written:
                    written[place.form] = place.payload.write(sending)
            except RequestError as error:
                failed = error
            else:
                found.append(Publication(place.template.fill(values), written[place.form], qos, retain, expiry_s))
        if not found:
            what = f"profile {self.description.name} has no topic for {kind}"
            raise failed or RequestError(what, "add a row [[publish]] to it, or take another profile")
        self.missing = failed.message if failed else ""
        return found

    def subscriptions(self, own: Ego) -> frozenset[tuple[str, int]]:
        """Return topic filters with their quality of service, for the station's current or last known position.

        A station that never had a position subscribes to no tile, unless the profile has a fallback.
        """
        centre = self._subscribed_tile(own)
        tiles = ["/".join(one.digits()) for one in centre.around()] if centre else []
        return frozenset(asked for place in self._subscribe for asked in self._asked(place, tiles))

    def lacks(self, own: Ego) -> tuple[bool, str]:
        """Return True if nothing can be published without a position, and a text that says what is omitted."""
        if own.is_known or self.description.tiles.fallback:
            return False, ""
        by_tile = [place.template.needs("quadkey") for place in self._publish]
        is_subscribed = self.moves and self._centre is None
        undone = [word for word, is_so in (("published", any(by_tile)), ("subscribed", is_subscribed)) if is_so]
        return any(by_tile) and all(by_tile), f"no position: nothing is {' or '.join(undone)} by tile" if undone else ""

    def receive(self, delivery: Delivery) -> ReceivedPdu:
        """Return the PDU of a delivery; `noted` has a remark about it, or is empty.

        Raises RefusedError for an unknown topic, a message that the broker had retained, an invalid payload, and sizes
        outside MAX_PAYLOAD and MAX_PDU.
        """
        self.noted = ""
        topic, payload, is_retained, _ = delivery
        if len(payload) > MAX_PAYLOAD:
            raise RefusedError(Reason.PAYLOAD, f"{topic[:64]}: payload of {len(payload)} octets; at most {MAX_PAYLOAD}")
        place, kind, port = self._find(topic)
        if is_retained and not self._rule(kind).accept_retained:
            raise RefusedError(Reason.RETAINED, f"{topic[:64]}: retained by the broker, of unknown age")
        try:
            pdu, source = place.payload.read(kind, payload)
        except RefusedError as error:
            raise RefusedError(error.reason, f"{topic[:64]}: {error.message}", error.hint) from None
        _check_pdu(topic, pdu)
        return ReceivedPdu(pdu, port, source)

    def connected(self) -> Publication | None:
        """Return the station's status message after the connection; None if the profile has none."""
        return self._said(self.description.status.topic, self.description.status.connected)

    def closing(self) -> Publication | None:
        """Return the status message before the station closes the connection; None if the profile has none."""
        return self._said(self.description.status.topic, self.description.status.closing)

    def lost(self) -> Publication | None:
        """Return the last will; None if the profile has none."""
        status = self.description.status
        return self._said(status.lost_topic or status.topic, status.lost)

    def _said(self, topic: str, text: str) -> Publication | None:
        if not topic or not text:
            return None
        status = self.description.status
        payload = fill_text(text, self._own).encode()
        return Publication(Template(topic).fill(self._own), payload, status.qos, status.retain, None)

    def _rule(self, kind: str) -> TypeRule:
        return self.description.types.get(kind, _NO_RULE)

    def _own_tile(self, own: Ego) -> str:
        tiles = self.description.tiles
        depth = tiles.depth(tiles.publish_depth)
        if own.is_known:
            return tile(own.position, depth).digits()
        if tiles.fallback:
            return tiles.fallback[:depth]
        hint = "wait for GNSS, give the station a surveyed place, or set tiles.fallback in the profile"
        raise RequestError(f"profile {self.description.name} publishes by tile, and the position is not known", hint)

    def _subscribed_tile(self, own: Ego) -> Tile | None:
        """Return the tile in the centre of the subscribed tiles; its position and size have hysteresis."""
        tiles = self.description.tiles
        if own.is_known:
            speed = abs(own.speed) / 100
            larger = sum(speed >= limit for limit in tiles.speeds_m_s)
            slower = sum(speed >= limit * _SLOWER for limit in tiles.speeds_m_s)
            self._larger = min(max(self._larger, larger), slower)
            depth = tiles.depth(max(1, tiles.subscribe_depth - self._larger))
            self._centre = follow(own.position, depth, self._centre)
        elif self._centre is None and tiles.fallback:
            return from_digits(tiles.fallback[: tiles.depth(tiles.subscribe_depth)])
        return self._centre

    def _asked(self, place: _Place, tiles: list[str]) -> Iterator[tuple[str, int]]:
        is_tiled = place.template.needs("quadkey")
        for kind in place.types if place.types and place.template.needs("type") else (None,):
            rule = self._rule(kind) if kind else _NO_RULE
            values = {**self._own, "type": rule.topic or kind} if kind else self._own
            qos = self.description.qos if rule.qos is None else rule.qos
            for digits in tiles if is_tiled else ("",):
                yield place.template.filter({**values, "quadkey": digits}), qos

    def _find(self, topic: str) -> tuple[_Place, str, int | None]:
        """Return the row, type and BTP port of a topic. Raises RefusedError for an unknown topic."""
        if len(topic) > _MAX_TOPIC:
            raise RefusedError(Reason.TOPIC, f"topic {topic[:64]!r}... is longer than {_MAX_TOPIC}")
        for place in self._subscribe:
            match = place.pattern.fullmatch(topic)
            if not match:
                continue
            found = match.groupdict()
            name = found.get("type") or ""
            kind = self._kinds.get(name, name)
            if place.holds(kind) or not name:
                return place, kind, _port(topic, found.get("port"))
        known = ", ".join(row.topic for row in self.description.subscribe)
        raise RefusedError(Reason.TOPIC, f"unknown topic {topic[:64]!r}; known: {known}")

    def _place(self, row: TopicRow) -> _Place:
        template = Template(row.topic, is_filter=True)
        return _Place(template, row.payload, self._form(row.payload), row.types, template.pattern(self._own))

    def _form(self, form: Form) -> Payload:
        match form:
            case "vcaptain":
                return VCaptain(self.identity.host)
            case "binary":
                return Binary()
            case "base64":
                return Base64()
            case "orange":
                check_value("uuid", self.identity.uuid)
                return Orange(self.identity.uuid, self.description.types, self._codec)
        if self._codec is None:
            what = f"profile {self.description.name}: payload {form!r} needs the message library, which is not there"
            raise ConfigurationError(what, "`make codec` builds it")
        if form == "orange-raw":
            check_value("uuid", self.identity.uuid)
            return OrangeRaw(self.identity.uuid, self.description.types, self._codec)
        return (NapReceived if form == "nap" else NapToSend)(self.identity.station, self._codec, self._note)

    def _note(self, text: str) -> None:
        self.noted = text

    def _check_identity(self) -> None:
        rows: tuple[TopicRow, ...] = (*self.description.publish, *self.description.subscribe)
        status = self.description.status
        topics = [*(row.topic for row in rows), *filter(None, (status.topic, status.lost_topic))]
        for name, value in self._own.items():
            if any(Template(topic, is_filter=True).needs(name) for topic in topics):
                check_value(name, value)


def _port(topic: str, text: str | None) -> int | None:
    if text is None:
        return None
    if not re.fullmatch("[0-9]{1,5}", text) or int(text) > 65535:
        raise RefusedError(Reason.TOPIC, f"topic {topic[:64]!r}: invalid BTP port: {text[:16]!r}")
    return int(text)


def _check_pdu(topic: str, pdu: bytes) -> None:
    size = len(pdu)
    if ITS_HEADER <= size <= MAX_PDU:
        return
    reason = Reason.EMPTY_PDU if not pdu else Reason.SHORT_PDU if size < ITS_HEADER else Reason.LONG_PDU
    raise RefusedError(reason, f"{topic[:64]}: a PDU of {size} octets; a PDU has {ITS_HEADER} to {MAX_PDU}")
