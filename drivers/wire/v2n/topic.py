"""Topic templates with variables, such as `v2x/btp/{port}`: topics to publish, and filters to receive them."""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

from board.runtime.errors import ConfigurationError, RequestError

OF_STATION = ("host", "station", "uuid", "prefix")
VARIABLES = ("host", "station", "uuid", "type", "port", "quadkey", "prefix")
OPEN = ("type", "port")  # variables that a filter may leave open, to receive every value
MAX_TOPIC = 65535  # octets of UTF-8 (MQTT 5.0, 1.5.4)

_GAP = re.compile(r"\{([^{}]*)\}")
_FORBIDDEN = re.compile("[+#\0]")
_TILE = "[0-3](?:/[0-3])*"


class Template:
    """Template of topics for publications, or of a filter for subscriptions.

    Raises ConfigurationError for an unknown variable, and for characters that a topic or filter must not have.
    """

    def __init__(self, text: str, is_filter: bool = False) -> None:
        self.text = text
        self.variables = frozenset(_GAP.findall(text))
        for name in sorted(self.variables - set(VARIABLES)):
            raise ConfigurationError(f"{text!r}: unknown variable of topics: {{{name}}}", _remedy(name, VARIABLES))
        rest = _GAP.sub("", text)
        if "{" in rest or "}" in rest:
            raise ConfigurationError(f"{text!r}: a brace has no partner", "write {type}")
        if not text or len(text.encode("utf-8", "replace")) > MAX_TOPIC:
            raise ConfigurationError(f"{text[:60]!r}: a topic has 1 to {MAX_TOPIC} octets")
        _check(text, is_filter)

    def needs(self, name: str) -> bool:
        return name in self.variables

    def fill(self, values: Mapping[str, str]) -> str:
        """Return the topic for the values. Raises RequestError if a value makes it invalid."""
        topic = _GAP.sub(lambda gap: values[gap[1]], self.text)
        if _FORBIDDEN.search(topic) or len(topic.encode("utf-8", "replace")) > MAX_TOPIC:
            raise RequestError(f"invalid topic: {topic[:60]!r}: {self.text!r} was filled with {_shown(values)}")
        return topic

    def filter(self, values: Mapping[str, str]) -> str:
        """Return the filter for a subscription: `+` for each level with a type or port that has no value."""
        levels = []
        for level in self.text.split("/"):
            is_open = any(gap[1] in OPEN and gap[1] not in values for gap in _GAP.finditer(level))
            levels.append("+" if is_open else _GAP.sub(lambda gap: values[gap[1]], level))
        return "/".join(levels)

    def pattern(self, values: Mapping[str, str]) -> re.Pattern[str]:
        """Return the regular expression of the topics that the filter receives; its groups are `type` and `port`."""
        *levels, last = self.text.split("/")
        seen: set[str] = set()
        parts = [_level(level, values, seen) for level in levels]
        if last == "#":
            return re.compile("/".join(parts) + "(?:/.*)?" if parts else ".*", re.DOTALL)
        return re.compile("/".join((*parts, _level(last, values, seen))), re.DOTALL)


def check_value(name: str, value: str) -> None:
    """Check a value for topics. Raises ConfigurationError if it is empty or has a forbidden character."""
    if not value:
        raise ConfigurationError(f"{name} is empty, but the profile's topics contain it", f"set {name}")
    if _FORBIDDEN.search(value) or (name != "prefix" and "/" in value):
        raise ConfigurationError(f"{name}: invalid in a topic: {value!r}", "leave + # / and NUL out")
    if not value.isprintable():
        raise ConfigurationError(f"{name}: invalid in a topic: {value!r}", "leave control characters out")


def check_text(text: str) -> None:
    """Check the template of a status text. Raises ConfigurationError for variables other than those of the station."""
    for name in sorted(set(_GAP.findall(text)) - set(OF_STATION)):
        raise ConfigurationError(f"{text!r}: {{{name}}} is not a variable of the station", _remedy(name, OF_STATION))


def fill_text(text: str, values: Mapping[str, str]) -> str:
    return _GAP.sub(lambda gap: values[gap[1]], text)


def _level(level: str, values: Mapping[str, str], seen: set[str]) -> str:
    if level == "+":
        return "[^/]*"
    found, end = "", 0
    for gap in _GAP.finditer(level):
        found += re.escape(level[end : gap.start()]) + _gap(gap[1], values, seen)
        end = gap.end()
    return found + re.escape(level[end:])


def _gap(name: str, values: Mapping[str, str], seen: set[str]) -> str:
    """Return the regular expression of a variable; a repeated variable must have the same value."""
    if name not in OPEN:
        return _TILE if name == "quadkey" else re.escape(values[name])
    if name in seen:
        return f"(?P={name})"
    seen.add(name)
    return f"(?P<{name}>[^/]+)"


def _check(text: str, is_filter: bool) -> None:
    if "\0" in text or (not is_filter and _FORBIDDEN.search(text)):
        raise ConfigurationError(f"{text!r}: no message can be published there", "leave + # and NUL out")
    levels = text.split("/")
    if is_filter and levels[0] == "$share":
        remedy = "leave out $share and the group: a vehicle needs all messages, not a share of them"
        raise ConfigurationError(f"{text!r}: shared subscriptions are not allowed in a profile", remedy)
    for place, level in enumerate(levels):
        is_wild = level == "+" or (level == "#" and place == len(levels) - 1)
        if not is_wild and ("+" in level or "#" in level):
            remedy = "+ is a whole level and # the last one: v2x/+/#"
            raise ConfigurationError(f"{text!r}: invalid level of a filter: {level!r}", remedy)


def _remedy(name: str, known: Sequence[str]) -> str:
    close = get_close_matches(name, known, n=1)
    return f"did you mean {{{close[0]}}}?" if close else "known: " + " ".join(f"{{{word}}}" for word in known)


def _shown(values: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {value!r}" for name, value in values.items())[:120]
