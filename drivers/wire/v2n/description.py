"""Description of a profile: topics, forms of payloads, rules. profiles/template.toml explains its keys."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Literal

from board.runtime.errors import ConfigurationError
from drivers.wire.quadkey import MAX_DEPTH, from_digits
from drivers.wire.v2n.topic import Template, check_text

Form = Literal["vcaptain", "binary", "base64", "orange", "orange-raw", "nap", "nap-body"]
_IDS = frozenset(map(str, range(256)))  # messageIDs, for types without a name; also protocolVersions
OTHERS, UNKNOWN = "others", "unknown"  # row of TypeRule.standard for other versions; its default value
_DECODING = ("orange-raw", "nap", "nap-body")
_MAY_DECODE = ("orange",)


@dataclass(frozen=True)
class TopicRow:
    """A topic, and the form of its payloads.

    topic    template of the topic.
    payload  form of the payload.
    types    types of messages. Empty: all.
    """

    topic: str
    payload: Form
    types: tuple[str, ...] = ()


@dataclass(frozen=True)
class PublishRow(TopicRow):
    """A topic that messages are published to.

    topic    template of the topic.
    payload  form of the payload.
    types    only these types. Empty: all.
    """

    def __post_init__(self) -> None:
        Template(self.topic)


@dataclass(frozen=True)
class SubscribeRow(TopicRow):
    """A topic that messages are taken from.

    topic    template of the topic. A received topic belongs to the first row that it fits.
    payload  form of the payload.
    types    types with a subscription each. Empty: one for all.
    """

    def __post_init__(self) -> None:
        Template(self.topic, is_filter=True)


@dataclass(frozen=True)
class TypeRule:
    """Differences of one message type.

    topic            name of the type in topics and envelopes. Empty: its own.
    qos              as in the profile if left out.
    retain           as in the profile if left out.
    expiry_s         a broker forgets the message after this time (MQTT 5). Left out: as in the profile.
    accept_retained  take messages that the broker has retained.
    schema_version   member of the envelope in the form orange.
    standard         member of the PDU in the form orange. May be a table by the PDU's protocolVersion, with a row
                     `others`.
    origin           member of the form orange.

    Raises ConfigurationError for a qos other than 0 and 1, an expiry_s outside 1 to 2**32 - 1 s, a topic with + # / or
    NUL, and a standard without rows or of an invalid protocolVersion.
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
    """Status messages of the station. {host}, {station}, {uuid} and {prefix} are replaced.

    topic       topic of the status messages. Empty: none are sent.
    lost_topic  topic of the last will. Empty: topic.
    connected   text after the connection. Empty: none.
    closing     text before an orderly end. Empty: none.
    lost        text of the last will. Empty: none.
    qos         quality of service.
    retain      the broker retains them.

    Raises ConfigurationError for a qos other than 0 and 1, and for an invalid topic or text.
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
    """Map tiles of the variable {quadkey}.

    publish_depth    levels of the tile that own messages are published to.
    subscribe_depth  levels of the tile and its 8 neighbours that are subscribed to, at standstill.
    speeds_m_s       from each of these speeds on, tiles are one level larger.
    least            least of both depths.
    most             most of both depths.
    fallback         quadkey of a station without a position. Empty: it neither publishes nor subscribes by tile.

    Raises ConfigurationError for a depth or fallback out of range, for bounds with which messages would be lost
    (publish_depth below subscribe_depth), and for speeds that do not rise.
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
                raise ConfigurationError(f"{name}: depth out of range: {getattr(self, name)}", f"give 1 to {MAX_DEPTH}")
        if self.least > self.most:
            raise ConfigurationError(f"least: {self.least} is larger than most, {self.most}")
        if self.publish_depth < self.subscribe_depth:
            what = f"publish_depth: {self.publish_depth} is smaller than subscribe_depth, {self.subscribe_depth}"
            raise ConfigurationError(what, "no subscriber would find these messages; publish at least as deep")
        if any(speed <= 0 for speed in self.speeds_m_s) or list(self.speeds_m_s) != sorted(set(self.speeds_m_s)):
            raise ConfigurationError(f"speeds_m_s: {list(self.speeds_m_s)} do not rise", "write [8.3, 22.0]")
        self._check_bounds()
        self._check_fallback()

    def _check_bounds(self) -> None:
        """Raise ConfigurationError if this station and stations without own bounds would miss each other's messages."""
        if self.most < self.subscribe_depth:
            what = f"most: {self.most} is smaller than subscribe_depth, {self.subscribe_depth}"
            raise ConfigurationError(
                what, f"no subscriber would find these messages; give at least {self.subscribe_depth}"
            )
        if self.least > self.publish_depth:
            what = f"least: {self.least} is larger than publish_depth, {self.publish_depth}"
            raise ConfigurationError(
                what, f"this station would find no messages of others; give at most {self.publish_depth}"
            )

    def _check_fallback(self) -> None:
        if not self.fallback:
            return
        try:
            from_digits(self.fallback)
        except ValueError as error:
            raise ConfigurationError(f"fallback: {error}", "write its digits: 12023000003020230") from error
        if len(self.fallback) < self.subscribe_depth:
            what = f"fallback: {self.fallback} is smaller than subscribe_depth, {self.subscribe_depth}"
            hint = f"no subscriber would find these messages; write at least {self.subscribe_depth} digits"
            raise ConfigurationError(what, hint)

    def depth(self, wanted: int) -> int:
        return min(max(wanted, self.least), self.most)


@dataclass(frozen=True)
class ProfileDescription:
    """Profile: the topics and payloads of a broker's community.

    name         name in status and errors.
    publish      topics that messages are published to.
    subscribe    topics that messages are taken from.
    description  one line about the profile.
    prefix       value of {prefix}, unless the interface sets one.
    qos          of publications and subscriptions: 0 or 1.
    retain       the broker retains messages.
    expiry_s     a broker forgets a message after this time (MQTT 5). Left out: the rest of its lifetime, or never for a
                 retained message.
    status       status messages of the station.
    tiles        map tiles of the variable {quadkey}.
    types        rules by name of the type, or by messageID.

    Raises ConfigurationError for a qos other than 0 and 1, an expiry_s outside 1 to 2**32 - 1 s, and a type with + # /
    or NUL.
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
        """True if a form of payload always decodes messages, so that the message library is required."""
        return any(row.payload in _DECODING for row in (*self.publish, *self.subscribe))

    @property
    def may_decode(self) -> bool:
        """True if a form of payload decodes messages, always or only when the message library is present."""
        return self.needs_codec or any(row.payload in _MAY_DECODE for row in (*self.publish, *self.subscribe))

    def check_types(self, known: Collection[str]) -> None:
        """Check the types of rows and rules. Raises ConfigurationError for one not in known that is not a messageID."""
        named = {*self.types, *(kind for row in (*self.publish, *self.subscribe) for kind in row.types)}
        for kind in sorted(named.difference(known)):
            if kind in _IDS:
                continue
            close = get_close_matches(kind, known, n=1)
            others = ", ".join(sorted(filter(None, known)))
            hint = f"did you mean {close[0]}?" if close else f"known: {others}, and messageIDs"
            raise ConfigurationError(f"types: unknown type: {kind!r}", hint)

    def adapted(
        self, qos: int | None = None, status_topic: str = "", depths: tuple[int, ...] = ()
    ) -> "ProfileDescription":
        """Return the profile with an interface's own settings.

        qos           quality of service of all publications and subscriptions; None: the profile's.
        status_topic  topic of the last will, such as "v2xstatus" for listeners of older boxes; empty: the profile's.
        depths        least and most levels of tiles; empty: the profile's.

        Raises ConfigurationError for depths with which stations would not find each other.
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
        raise ConfigurationError(f"qos: unsupported: {qos}", "give 0 or 1")


def _check_expiry(expiry_s: int | None) -> None:
    if expiry_s is not None and not 1 <= expiry_s < 1 << 32:
        raise ConfigurationError(f"expiry_s: out of range: {expiry_s}", "give whole seconds, at least 1")


def _check_versions(standards: Collection[str]) -> None:
    hint = f'write {{ 1 = "...", 2 = "..." }}, or {OTHERS} = "..." for versions without a row'
    if not standards:
        raise ConfigurationError("standard: empty table", hint)
    for version in standards:
        if version not in _IDS and version != OTHERS:
            raise ConfigurationError(f"standard: invalid protocolVersion {version!r}; 0 to 255", hint)


def _check_type(name: str) -> None:
    if not name or any(letter in "+#/\0" for letter in name):
        raise ConfigurationError(f"types: {name!r} is invalid as a level of a topic", "leave + # / and NUL out")
