"""JSON of a peer: bounded, and each value with its path where it is not what it should be."""

import json
from typing import Any, NoReturn

from drivers.reason import Reason
from drivers.wire.v2n_message import MAX_PAYLOAD, RefusedError

MAX_DEPTH = 64  # levels; a CPM as JSON has 20
MAX_SHOWN = 40  # characters of a wrong value

KINDS = {dict: "an object", list: "an array", str: "text", int: "an integer", float: "a number", bool: "true or false"}


def read_object(payload: bytes) -> dict[str, Any]:
    """The object that a payload holds. Raises RefusedError: too long, too deep, not JSON, not UTF-8, no object."""
    if len(payload) > MAX_PAYLOAD:
        refuse("", f"{len(payload)} octets are above {MAX_PAYLOAD}")
    try:
        value = json.loads(payload.decode(), parse_constant=_no_number)
    except RecursionError:
        refuse("", f"it is nested deeper than {MAX_DEPTH} levels")
    except ValueError as error:  # no JSON, no UTF-8, and an integer of more digits than Python reads
        refuse("", f"it is not JSON: {error}")
    check_depth(value)
    if not isinstance(value, dict):
        refuse("", f"{shown(value)} is no object")
    return value


def member(table: dict[str, Any], name: str, kind: type, path: str = "") -> Any:
    """A member that has to be there. Raises RefusedError."""
    place = f"{path}.{name}" if path else name
    if name not in table:
        refuse(place, "is missing")
    value = table[name]
    if type(value) is not kind:
        refuse(place, f"{shown(value)} is not {KINDS[kind]}")
    return value


def refuse(path: str, why: str) -> NoReturn:
    raise RefusedError(Reason.PAYLOAD, f"{path}: {why}" if path else f"the payload: {why}")


def shown(value: object) -> str:
    """A value, shortened."""
    if isinstance(value, dict | list):
        return KINDS[type(value)]
    text = ascii(value) if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."


def check_depth(value: object) -> None:
    """Level by level, so that no depth is too deep to be told."""
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
    raise ValueError(f"{word} is no number of JSON")
