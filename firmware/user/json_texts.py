"""JSON values one after the other in lines of text: one a line, or each over many lines as `jq` prints them.

A line that begins no value stands for itself.
"""

import json
import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple, NoReturn

from board.errors import RequestError

# What opens, closes or hides a bracket. A string does not go beyond its line.
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"?|[][{}]')
_STEP = {"{": 1, "[": 1, "}": -1, "]": -1}

# The largest message has some 100 kB of JSON; a list of all vectors is one value as well.
MAX_TEXT = 64 << 20  # characters


class Text(NamedTuple):
    """One value as text, and the number of the line where it begins."""

    line: int
    text: str


def split(lines: Iterable[str]) -> Iterator[Text]:
    """The values of a stream, each as soon as its last line is there. None is longer than MAX_TEXT.

    One that is broken ends where a line begins with the brace of the next, so that this one is not lost.
    """
    pending: list[str] = []
    begun = depth = size = 0
    for number, line in enumerate(lines, 1):
        is_next = line.startswith("{") and pending and pending[0].startswith("{")
        if is_next or size > MAX_TEXT:
            yield Text(begun, "".join(pending))
            pending, depth, size = [], 0, 0
        if not pending and not line.strip():
            continue
        is_json = bool(pending) or line.lstrip().startswith(("{", "["))
        begun = begun if pending else number
        pending.append(line)
        size += len(line)
        depth += sum(_STEP.get(token, 0) for token in _TOKEN.findall(line)) if is_json else 0
        if depth <= 0:
            yield Text(begun, "".join(pending))
            pending, depth, size = [], 0, 0
    if pending:
        yield Text(begun, "".join(pending))


def parse(text: str, where: str) -> object:
    """A JSON value. Raises RequestError with the place of the mistake; NaN and Infinity are none."""
    try:
        return json.loads(text, parse_constant=_no_number)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, character {error.colno}"
        raise RequestError(f"{where}: it is not JSON: {error.msg} at {place}") from error
    except (ValueError, RecursionError) as error:
        raise RequestError(f"{where}: it is not JSON: {error}") from error


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")
