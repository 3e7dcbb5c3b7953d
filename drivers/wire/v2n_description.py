"""A profile as it is written down: topics, forms of payloads, rules. profiles/template.toml explains its keys."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Literal

from board.errors import ConfigurationError
from drivers.wire.quadkey import MAX_DEPTH, from_digits
from drivers.wire.v2n_topic import Template, check_text

Form = Literal["vcaptain", "binary", "base64", "orange", "orange-raw", "nap", "nap-body"]
_IDS = frozenset(map(str, range(256)))  # which a type has in topics where it has no name; and protocolVersions
OTHERS, UNKNOWN = "others", "unknown"  # row of TypeRule.standard for other versions; its value without one
_DECODING = ("orange-raw", "nap", "nap-body")
_MAY_DECODE = ("orange",)


@dataclass(frozen=True)
class Row:
    """Where messages are published, or from where they are taken.

    topic    template.
    payload  form of what is there.
    types    that go there, or are asked for; empty: all.
    """

    topic: str
    payload: Form
    types: tuple[str, ...] = ()


@dataclass(frozen=True)
class PublishRow(Row):
    """Where messages are published."""

    def __post_init__(self) -> None:
        Template(self.topic)


@dataclass(frozen=True)
class SubscribeRow(Row):
    """From where messages are taken."""

    def __post_init__(self) -> None:
        Template(self.topic, is_filter=True)


@dataclass(frozen=True)
class TypeRule:
    """What differs for one type of message.

    topic            its name in topics and envelopes; empty: its own.
    qos, retain      as in the profile where absent.
    expiry_s         after which a broker forgets it (MQTT 5); as in the profile where absent.
    accept_retained  take what a broker had kept.
    schema_version   of the envelope, standard of the PDU, origin: members that the form orange has.
                     standard may be a table by the PDU's protocolVersion; its row `others` is for those without one.
    """

    topic: str = ""
    qos: int | None = None
    retain: bool | None = None
    expiry_s: int | None = None
    accept_retained: bool = False
    schema_version: str = "2.0.0"
    standard: str | dict[str, str] = UNKNOWN
    origin: str = ""

    def __post_init__(self) -> None:
        _check_qos(self.qos)
        _check_expiry(self.expiry_s)
        if self.topic:
            _check_type(self.topic)
        if isinstance(self.standard, dict):
            _check_versions(self.standard)

    def standard_of(self, version: int) -> str:
        """Return the standard of a PDU by its protocolVersion."""
        if isinstance(self.standard, str):
            return self.standard
        return self.standard.get(str(version), self.standard.get(OTHERS, UNKNOWN))


@dataclass(frozen=True)
class Status:
    """What the station says of itself; {host}, {station}, {uuid} and {prefix} are filled in.

    topic                     empty: it says nothing.
    lost_topic                of the last will; empty: topic.
    connected, closing, lost  texts; empty: not said.
    """

    topic: str = ""
    lost_topic: str = ""
    connected: str = ""
    closing: str = ""
    lost: str = ""
    qos: int = 1
    retain: bool = False

    def __post_init__(self) -> None:
        _check_qos(self.qos)
        for topic in filter(None, (self.topic, self.lost_topic)):
            Template(topic)
        for text in (self.topic, self.lost_topic, self.connected, self.closing, self.lost):
            check_text(text)


@dataclass(frozen=True)
class Tiles:
    """Which tiles {quadkey} stands for.

    publish_depth    levels of own messages' tile.
    subscribe_depth  levels of the tile, and its 8 neighbours, that messages are taken from when standing.
    speeds_m_s       at each of these the tiles are one level larger.
    least, most      bounds of both depths.
    fallback         quadkey of a station that does not know where it is; empty: it publishes and takes nothing.
    """

    publish_depth: int = 22
    subscribe_depth: int = 17
    speeds_m_s: tuple[float, ...] = ()
    least: int = 1
    most: int = MAX_DEPTH
    fallback: str = ""

    def __post_init__(self) -> None:
        for name in ("publish_depth", "subscribe_depth", "least", "most"):
            if not 1 <= getattr(self, name) <= MAX_DEPTH:
                raise ConfigurationError(f"{name}: {getattr(self, name)} is no depth", f"give 1 to {MAX_DEPTH}")
        if self.least > self.most:
            raise ConfigurationError(f"least: {self.least} is above most, {self.most}")
        if self.publish_depth < self.subscribe_depth:
            what = f"publish_depth: {self.publish_depth} is above the tiles of subscribe_depth, {self.subscribe_depth}"
            raise ConfigurationError(what, "nobody would find these messages: publish at least as deep")
        if any(speed <= 0 for speed in self.speeds_m_s) or list(self.speeds_m_s) != sorted(set(self.speeds_m_s)):
            raise ConfigurationError(f"speeds_m_s: {list(self.speeds_m_s)} do not rise", "write [8.3, 22.0]")
        self._check_bounds()
        self._check_fallback()

    def _check_bounds(self) -> None:
        """Whether this station and those without bounds of their own find each other's messages."""
        if self.most < self.subscribe_depth:
            what = f"most: {self.most} is above the tiles of subscribe_depth, {self.subscribe_depth}"
            raise ConfigurationError(what, f"nobody would find these messages: give at least {self.subscribe_depth}")
        if self.least > self.publish_depth:
            what = f"least: {self.least} is below the tiles of publish_depth, {self.publish_depth}"
            raise ConfigurationError(what, f"it would find nobody's messages: give at most {self.publish_depth}")

    def _check_fallback(self) -> None:
        if not self.fallback:
            return
        try:
            from_digits(self.fallback)
        except ValueError as error:
            raise ConfigurationError(f"fallback: {error}", "write its digits: 12023000003020230") from error
        if len(self.fallback) < self.subscribe_depth:
            what = f"fallback: {self.fallback} is above the tiles of subscribe_depth, {self.subscribe_depth}"
            hint = f"nobody would find these messages: write at least {self.subscribe_depth} digits"
            raise ConfigurationError(what, hint)

    def depth(self, wanted: int) -> int:
        return min(max(wanted, self.least), self.most)


@dataclass(frozen=True)
class ProfileDescription:
    """A profile.

    name       by which status and mistakes call it.
    prefix     value of {prefix} unless the interface sets one.
    qos        of publications and subscriptions: 0 or 1. 2 costs two more ways, and old messages are worth less.
    retain     of publications.
    expiry_s   of publications; absent: their lifetime, or none where they are retained.
    types      rules by name of the type; its messageID where it has none.
    """

    name: str
    publish: tuple[PublishRow, ...]
    subscribe: tuple[SubscribeRow, ...]
    description: str = ""
    prefix: str = ""
    qos: int = 1
    retain: bool = False
    expiry_s: int | None = None
    status: Status = field(default_factory=Status)
    tiles: Tiles = field(default_factory=Tiles)
    types: dict[str, TypeRule] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_qos(self.qos)
        _check_expiry(self.expiry_s)
        for row in (*self.publish, *self.subscribe):
            for kind in row.types:
                _check_type(kind)

    @property
    def needs_codec(self) -> bool:
        """Whether a form of payload decodes messages."""
        return any(row.payload in _DECODING for row in (*self.publish, *self.subscribe))

    @property
    def may_decode(self) -> bool:
        """Return whether a form of payload decodes messages, always or only with the message library."""
        return self.needs_codec or any(row.payload in _MAY_DECODE for row in (*self.publish, *self.subscribe))

    def check_types(self, known: Collection[str]) -> None:
        """Raises ConfigurationError for a type of its rows or rules that is none of known, and no messageID."""
        named = {*self.types, *(kind for row in (*self.publish, *self.subscribe) for kind in row.types)}
        for kind in sorted(named.difference(known)):
            if kind in _IDS:
                continue
            close = get_close_matches(kind, known, n=1)
            others = ", ".join(sorted(filter(None, known)))
            hint = f"did you mean {close[0]}?" if close else f"known: {others}, and messageIDs"
            raise ConfigurationError(f"types: {kind!r} is no type of this station", hint)

    def adapted(
        self, qos: int | None = None, status_topic: str = "", depths: tuple[int, ...] = ()
    ) -> "ProfileDescription":
        """The profile with what an interface wants otherwise.

        qos           of all that is sent and taken.
        status_topic  of the last will: where boxes of old listen for that is "v2xstatus".
        depths        least and most levels of tiles; empty: the profile's.

        Raises ConfigurationError for depths by which stations would not find each other.
        """
        found = self
        if qos is not None:
            types = {name: replace(rule, qos=qos) for name, rule in self.types.items()}
            found = replace(found, qos=qos, types=types, status=replace(self.status, qos=qos))
        if status_topic:
            found = replace(found, status=replace(found.status, lost_topic=status_topic))
        if depths:
            try:
                found = replace(found, tiles=replace(self.tiles, least=depths[0], most=depths[1]))
            except ConfigurationError as error:
                raise ConfigurationError(f"depths {list(depths)}: {error.message}", error.hint) from error
        return found


def _check_qos(qos: int | None) -> None:
    if qos not in (None, 0, 1):
        raise ConfigurationError(f"qos: {qos} is no quality of service", "give 0 or 1")


def _check_expiry(expiry_s: int | None) -> None:
    if expiry_s is not None and not 1 <= expiry_s < 1 << 32:
        raise ConfigurationError(f"expiry_s: {expiry_s} is no time of MQTT", "give whole seconds, at least 1")


def _check_versions(standards: Collection[str]) -> None:
    hint = f'write {{ 1 = "...", 2 = "..." }}, or {OTHERS} = "..." for versions without a row'
    if not standards:
        raise ConfigurationError("standard: empty table", hint)
    for version in standards:
        if version not in _IDS and version != OTHERS:
            raise ConfigurationError(f"standard: invalid protocolVersion {version!r}; 0 to 255", hint)


def _check_type(name: str) -> None:
    if not name or any(letter in "+#/\0" for letter in name):
        raise ConfigurationError(f"types: {name!r} cannot be a level of a topic", "leave + # / and NUL out")
