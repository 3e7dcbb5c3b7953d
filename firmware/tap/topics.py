"""Topic filters of a tap: all topics of a profile, or one tile."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from board.runtime.errors import ConfigurationError, RequestError
from drivers.mqtt.options import MqttOptions
from drivers.wire.quadkey import from_digits
from drivers.wire.v2n.description import Form, ProfileDescription, SubscribeRow, TopicRow
from drivers.wire.v2n.message import Identity
from drivers.wire.v2n.topic import Template, check_value

# Placeholders for the sender; a back end receives messages of every sender.
_SENDER = ("{host}", "{station}", "{uuid}")
_TILE = "{quadkey}"
MAX_TOPIC = 1024  # characters; matching a level with two placeholders takes quadratic time
# Forms of payloads: first those that cost least to read and lose nothing.
_READILY: tuple[Form, ...] = ("binary", "base64", "vcaptain", "orange", "orange-raw", "nap", "nap-body")
NO_STATION = -1  # invalid stationID: valid ones begin at 0


def tapped(description: ProfileDescription, is_published: bool, has_all: bool = False) -> ProfileDescription:
    """Return the profile of a back end, which receives from every sender.

    is_published  subscribe to topics where vehicles publish, instead of those where they receive: a profile may
                  separate them. A message published to several topics is taken from one of them.
    has_all       take a message from each of its topics.
    """
    rows: Iterable[TopicRow] = description.subscribe
    if is_published:
        rows = description.publish if has_all else _once(description.publish)
    # The first matching row is used, and {type} also matches text for {type}_enc. Longer topics therefore come first.
    ordered = sorted(rows, key=lambda row: -len(row.topic))
    return replace(
        description, subscribe=tuple(SubscribeRow(_open(row.topic), row.payload, row.types) for row in ordered)
    )


def copies(description: ProfileDescription, prefix: str) -> Callable[[str], bool]:
    """Return a function that tells whether an unknown topic carries copies of messages taken from another topic.

    Such topics pass the broker's filters, because `+` for {type}_enc also matches {type}.
    """
    values = {"prefix": prefix or description.prefix}
    patterns = [Template(_open(row.topic), is_filter=True).pattern(values) for row in description.publish]
    return lambda topic: len(topic) <= MAX_TOPIC and any(pattern.fullmatch(topic) for pattern in patterns)


def filters(description: ProfileDescription, prefix: str, tile: str = "") -> list[str]:
    """Return the topic filters for the broker, without `$share`.

    tile  quadkey of the only requested tile; empty: all tiles.

    Raises RequestError if a tile is requested but the profile's topics contain none.
    """
    if tile and not any(_TILE in row.topic for row in description.subscribe):
        raise RequestError(f"profile {description.name} has no tiles in its topics", "leave --tile out")
    values = {"prefix": prefix or description.prefix}
    if any(Template(row.topic, is_filter=True).needs("prefix") for row in description.subscribe):
        check_value("prefix", values["prefix"])
    cut = [Template(_cut(row.topic, tile), is_filter=True) for row in description.subscribe]
    return list(dict.fromkeys(template.filter(values) for template in cut))


def shared(group: str, text: str) -> str:
    """Return a filter whose messages go to one client of the group each (MQTT 5.0, 4.8.2).

    Without a group, each message goes to all clients.
    """
    return f"$share/{group}/{text}" if group else text


def identity(settings: MqttOptions) -> Identity:
    """Return the identity of a tap for its profile.

    A tap publishes nothing, so no message may count as its own echo.
    """
    name = settings.client_id
    return Identity(name, NO_STATION, name, settings.prefix)


def quadkey(text: str) -> str:
    """Return a valid quadkey. Raises ValueError for an invalid one."""
    return from_digits(text).digits()


def group_name(text: str) -> str:
    """Return a valid name of a shared subscription; it may be empty.

    Raises ValueError for / + # and unprintable characters.
    """
    if any(letter in "/+#\0" or not letter.isprintable() for letter in text):
        raise ValueError(f"{text!r}: invalid group; omit / + # and characters that do not print")
    return text


def own_filter(text: str) -> str:
    """Return a topic filter that replaces those of the profile.

    Raises ValueError if it is invalid or contains $share.
    """
    if text.startswith("$share/"):
        raise ValueError(f"{text!r}: omit $share and the group, and name the group by --group")
    if not text or len(text) > MAX_TOPIC or not text.isprintable():
        raise ValueError(f"{text[:40]!r}: not a topic filter of up to {MAX_TOPIC} letters; for example v2x/#")
    try:
        Template(text, is_filter=True)
    except ConfigurationError as error:
        raise ValueError(f"{error.message}; {error.hint}") from error
    return text


def _once(rows: Sequence[TopicRow]) -> list[TopicRow]:
    """Return rows such that each type is in one of them; rows with unchanged octets are preferred."""
    ordered = sorted(rows, key=lambda row: _READILY.index(row.payload))
    for row in ordered:
        if not row.types:
            return [row]
    found: list[TopicRow] = []
    left = {kind for row in rows for kind in row.types}
    for row in ordered:
        if types := tuple(kind for kind in row.types if kind in left):
            found.append(replace(row, types=types))
            left -= set(types)
    return found


def _open(topic: str) -> str:
    levels = topic.split("/")
    return "/".join("+" if any(name in level for name in _SENDER) else level for level in levels)


def _cut(topic: str, tile: str) -> str:
    """Return a filter for a tile; it ends there, because a topic has one level per digit of an unknown number."""
    front, gap, _ = topic.partition(_TILE)
    return front + "/".join([*tile, "#"]) if gap else topic
