"""JSON texts: splits a stream of lines into JSON values, one per line or over several lines.

A line that does not begin a JSON value is an item of its own.
"""

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple, NoReturn

from board.runtime.errors import RequestError

# Tokens that change the depth: brackets. Strings are matched too, since they may contain brackets; a string ends within
# its line.
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"?|[][{}]')
_STEP = {"{": 1, "[": 1, "}": -1, "]": -1}

# Limit of one text. The largest message has some 100 kB of JSON; a list of all test vectors is also one value.
MAX_TEXT = 64 << 20  # characters


class Text(NamedTuple):
    """Text of one JSON value, with the number of its first line."""

    line: int
    text: str


def split(lines: Iterable[str]) -> Iterator[Text]:
    """Yield the values of a stream, each as soon as its last line has arrived; a value is cut at MAX_TEXT characters.

    A value also ends before a line that begins with an opening brace: an incomplete value does not hide the next one.
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
    """Return the JSON value of a text.

    Raises RequestError with line and character if it is invalid; also for NaN, Infinity and duplicate members.
    """
    try:
        return json.loads(text, parse_constant=_no_number, object_pairs_hook=_members)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, character {error.colno}"
        raise RequestError(f"{where}: it is not JSON: {error.msg} at {place}") from error
    except (ValueError, RecursionError) as error:
        raise RequestError(f"{where}: it is not JSON: {error}") from error


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def _members(pairs: list[tuple[str, object]]) -> dict[str, object]:
    members = dict(pairs)
    if len(members) < len(pairs):
        twice, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise ValueError(f"the member {twice[:60]} is there twice")
    return members
