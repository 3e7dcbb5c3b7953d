"""Strict JSON of users: duplicate keys, NaN and lone surrogates become faults with their path (RFC 8259, RFC 7493)."""

import json
import math
from collections.abc import Iterator

from drivers.message import Fault

DEPTH = 64  # the deepest message of the standards has about 20 levels


class Invalid:
    """Placeholder for a value that JSON or I-JSON does not allow."""

    def __init__(self, problem: str) -> None:
        self.problem = problem


def parse(text: bytes) -> object:
    """Parse JSON; values that are not allowed become Invalid, for faults(). Raises ValueError if it is not JSON."""
    try:
        return json.loads(text.decode(), parse_constant=_constant, parse_float=_number, object_pairs_hook=_object)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def faults(value: object, path: str = "", depth: int = 0) -> Iterator[Fault]:
    """Yield the faults of parsed JSON, with the path of each. depth: number of values around this one."""
    if depth > DEPTH:
        yield path, f"nested in more than {DEPTH} values", None
    elif isinstance(value, Invalid):
        yield path, value.problem, None
    elif isinstance(value, str):
        if not value.isascii() and any("\ud800" <= letter <= "\udfff" for letter in value):
            yield path, "half of a surrogate pair is not a character", None
    elif isinstance(value, list):
        for index, one in enumerate(value):
            yield from faults(one, f"{path}[{index}]", depth + 1)
    elif isinstance(value, dict):
        for key, one in value.items():
            yield from faults(one, f"{path}.{key}" if path else key, depth + 1)


def _constant(text: str) -> Invalid:
    return Invalid(f"{text} is not a number of JSON")


def _number(text: str) -> float | Invalid:
    number = float(text)
    return number if math.isfinite(number) else Invalid(f"{text[:20]} is out of range")


def _object(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                found[key] = Invalid("duplicate key")
            seen.add(key)
    return found
