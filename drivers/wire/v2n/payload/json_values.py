"""JSON values of a peer: limits size and depth, reports invalid values with their path."""

import json
from typing import Any, NoReturn

from drivers.reason import Reason
from drivers.wire.v2n.message import MAX_PAYLOAD, RefusedError

MAX_DEPTH = 64  # levels of nesting; a CPM as JSON has 20
MAX_SHOWN = 40  # characters of an invalid value in messages

KINDS = {dict: "an object", list: "an array", str: "text", int: "an integer", float: "a number", bool: "true or false"}


def read_object(payload: bytes) -> dict[str, Any]:
    """Return the JSON object in a payload.

    Raises RefusedError if it is too long, nested too deep, not JSON, not UTF-8, or not an object.
    """
    if len(payload) > MAX_PAYLOAD:
        refuse("", f"{len(payload)} octets are above {MAX_PAYLOAD}")
    try:
        value = json.loads(payload.decode(), parse_constant=_no_number)
    except RecursionError:
        refuse("", f"it is nested deeper than {MAX_DEPTH} levels")
    except ValueError as error:  # invalid JSON, invalid UTF-8, or an integer of more digits than Python accepts
        refuse("", f"it is not JSON: {error}")
    check_depth(value)
    if not isinstance(value, dict):
        refuse("", f"not an object: {shown(value)}")
    return value


def member(table: dict[str, Any], name: str, kind: type, path: str = "") -> Any:
    """Return a required member. Raises RefusedError if it is missing or of another type."""
    place = f"{path}.{name}" if path else name
    if name not in table:
        refuse(place, "is missing")
    value = table[name]
    if type(value) is not kind:
        refuse(place, f"{shown(value)} is not {KINDS[kind]}")
    return value


def refuse(path: str, why: str) -> NoReturn:
    """Refuse a payload. Always raises RefusedError, with the path of the invalid member and why it is invalid."""
    raise RefusedError(Reason.PAYLOAD, f"{path}: {why}" if path else f"the payload: {why}")


def shown(value: object) -> str:
    """Return a value as text for messages, shortened."""
    if isinstance(value, dict | list):
        return KINDS[type(value)]
    text = ascii(value) if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."


def check_depth(value: object) -> None:
    """Check the depth of nesting, level by level, without recursion. Raises RefusedError above MAX_DEPTH levels."""
    level = [value]
    for _ in range(MAX_DEPTH):
        below: list[object] = []
        for item in level:
            if isinstance(item, dict):
                below.extend(item.values())
            elif isinstance(item, list):
                below.extend(item)
        level = below
    if level:
        refuse("", f"it is nested deeper than {MAX_DEPTH} levels")


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"invalid number in JSON: {word}")
