"""What a back end takes of a profile: everything that its templates can hold, or one tile of it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from board.errors import ConfigurationError, RequestError
from drivers.mqtt_options import MqttOptions
from drivers.wire.quadkey import from_digits
from drivers.wire.v2n_description import Form, ProfileDescription, Row, SubscribeRow
from drivers.wire.v2n_message import Identity
from drivers.wire.v2n_topic import Template, check_value

# Of whoever published: a back end takes all of them.
_SENDER = ("{host}", "{station}", "{uuid}")
_TILE = "{quadkey}"
MAX_TOPIC = 1024  # characters: where a level has two gaps, matching takes the square of it
# Forms of payloads, the ones that cost least and lose nothing first.
_READILY: tuple[Form, ...] = ("binary", "base64", "vcaptain", "orange", "orange-raw", "nap", "nap-body")
NO_STATION = -1  # stationIDs begin at 0


def tapped(description: ProfileDescription, is_published: bool, has_all: bool = False) -> ProfileDescription:
    """The profile of a back end: it receives from every sender.

    is_published  what vehicles publish, in place of what they receive: a profile may have a topic for each. A message
                  that goes to several is taken from one of them.
    has_all       no: from each.
    """
    rows: Iterable[Row] = description.subscribe
    if is_published:
        rows = description.publish if has_all else _once(description.publish)
    # The first that a topic fits is taken, and {type} fits what {type}_enc does.
    ordered = sorted(rows, key=lambda row: -len(row.topic))
    return replace(
        description, subscribe=tuple(SubscribeRow(_open(row.topic), row.payload, row.types) for row in ordered)
    )


def copies(description: ProfileDescription, prefix: str) -> Callable[[str], bool]:
    """Whether a topic that is not taken is one where vehicles publish what is taken from another.

    Filters let them through: `+` for {type}_enc is one for {type}.
    """
    values = {"prefix": prefix or description.prefix}
    patterns = [Template(_open(row.topic), is_filter=True).pattern(values) for row in description.publish]
    return lambda topic: len(topic) <= MAX_TOPIC and any(pattern.fullmatch(topic) for pattern in patterns)


def filters(description: ProfileDescription, prefix: str, tile: str = "") -> list[str]:
    """What the broker is asked for, without `$share`.

    tile  quadkey of the only tile that is wanted; empty: all. Raises RequestError where the topics name no tile.
    """
    if tile and not any(_TILE in row.topic for row in description.subscribe):
        raise RequestError(f"profile {description.name} has no tiles in its topics", "leave --tile out")
    values = {"prefix": prefix or description.prefix}
    if any(Template(row.topic, is_filter=True).needs("prefix") for row in description.subscribe):
        check_value("prefix", values["prefix"])
    cut = [Template(_cut(row.topic, tile), is_filter=True) for row in description.subscribe]
    return list(dict.fromkeys(template.filter(values) for template in cut))


def shared(group: str, text: str) -> str:
    """A filter of which each message goes to one client of the group (MQTT 5.0, 4.8.2); no group: to every client."""
    return f"$share/{group}/{text}" if group else text


def identity(settings: MqttOptions) -> Identity:
    """Who a tap is to its profile: nobody who publishes, so that nothing is taken for its own echo."""
    name = settings.client_id
    return Identity(name, NO_STATION, name, settings.prefix)


def quadkey(text: str) -> str:
    """A tile by its digits. Raises ValueError."""
    return from_digits(text).digits()


def group_name(text: str) -> str:
    """The name of a shared subscription, or nothing. Raises ValueError."""
    if any(letter in "/+#\0" or not letter.isprintable() for letter in text):
        raise ValueError(f"{text!r} cannot name a shared subscription: leave / + # out")
    return text


def own_filter(text: str) -> str:
    """A filter in place of the profile's. Raises ValueError."""
    if text.startswith("$share/"):
        raise ValueError(f"{text!r} is shared already: leave $share and the group out, and name that in --group")
    if not text or len(text) > MAX_TOPIC or not text.isprintable():
        raise ValueError(f"{text[:40]!r} is no filter of up to {MAX_TOPIC} letters: write for example v2x/#")
    try:
        Template(text, is_filter=True)
    except ConfigurationError as error:
        raise ValueError(f"{error.message}; {error.hint}") from error
    return text


def _once(rows: Sequence[Row]) -> list[Row]:
    """Of the rows that a message goes to one; the one with its octets as they are before others."""
    ordered = sorted(rows, key=lambda row: _READILY.index(row.payload))
    for row in ordered:
        if not row.types:
            return [row]
    found: list[Row] = []
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
    """A tile has a level for each digit, nobody knows how many: where it begins, the filter ends."""
    front, gap, _ = topic.partition(_TILE)
    return front + "/".join([*tile, "#"]) if gap else topic
