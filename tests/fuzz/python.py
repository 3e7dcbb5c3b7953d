"""The Python module under atheris: any octets, any JSON, any value, and only the errors that it promises.

Text, explanation and JSON take most of the time. With the argument --every=N they are asked for one input in N, which the octets alone
choose; without it for every input, so what --every=N has found shows again without it.
"""

import contextlib
import itertools
import json
import sys
import zlib
from typing import Any

import atheris
import captain_messages as messages

from tests.asn1.paths import is_readable, paths

MOST_PATHS = 40  # of one input that a reader reads

ALL = sorted(messages.all(), key=lambda message: message.name)
OPTION = "--every="  # libFuzzer leaves alone what begins with two hyphens
EVERY = max([1, *(int(one.removeprefix(OPTION)) for one in sys.argv if one.startswith(OPTION))])


def one_input(octets: bytes) -> None:
    """The first octet chooses the message by its name, the second the way in; run.py makes its seeds likewise."""
    if len(octets) < 2:
        return
    message = ALL[octets[0] % len(ALL)]
    WAYS[octets[1] % len(WAYS)](message, octets[2:])


def by_octets(message: Any, octets: bytes) -> None:
    try:
        value = message.decode(octets)
    except messages.DecodeError as error:
        assert isinstance(error.path, str)
        assert 0 <= error.bit <= 8 * len(octets)
        assert error.reason
        return
    encoded = message.encode(value)
    view = message.view(octets)
    assert view.to_dict() == value
    # Not the same octets each time: a view and JSON keep a bitmap of additions that are all absent, a dict does not.
    for again in (encoded, message.encode(view)):
        comes_back(message, again, value, encoded)
    if zlib.crc32(octets) % EVERY == 0:
        for plain in (False, True):
            comes_back(message, message.from_json(message.to_json(octets, plain=plain), plain=plain), value, encoded)
        message.text(octets)
        message.explain(octets)
        reads_alike(message, octets, value)


def reads_alike(message: Any, octets: bytes, value: Any) -> None:
    """A reader gives what decode gives."""
    there = {path: one for path, one in itertools.islice(paths(value), MOST_PATHS) if is_readable(message, path)}
    if there:
        assert message.reader(*there)(octets) == tuple(there.values())


def comes_back(message: Any, again: bytes, value: Any, encoded: bytes) -> None:
    """Decode gives the value, which encodes to the same; a list of named bits without the zeros at its end is the same (X.680 22.7)."""
    decoded = message.decode(again)
    assert message.encode(decoded) == encoded
    assert decoded == value or without_zeros(decoded) == without_zeros(value)


def without_zeros(value: Any) -> Any:
    """The zeros at the end of each bit string left out, in text; its length is compared where it counts, by its octets."""
    match value:
        case dict():
            return {name: without_zeros(one) for name, one in value.items()}
        case list():
            return [without_zeros(one) for one in value]
        case (bytes(octets), int(count)):
            return "".join(f"{octet:08b}" for octet in octets)[:count].rstrip("0")
        case (str(name), one):
            return name, without_zeros(one)
    return value


def by_json(message: Any, octets: bytes) -> None:
    for plain in (False, True):
        with contextlib.suppress(messages.EncodeError, UnicodeError):
            message.from_json(octets.decode("utf-8", "surrogateescape"), plain=plain)


def by_path(message: Any, octets: bytes) -> None:
    """Any text as a path: a reader, or a ValueError."""
    with contextlib.suppress(ValueError):
        message.reader(octets.decode("utf-8", "surrogateescape"))


def by_value(message: Any, octets: bytes) -> None:
    try:
        value = json.loads(octets)
    except (ValueError, RecursionError):
        value = octets
    try:
        message.encode(value)
    except messages.EncodeError as error:
        assert error.reason


WAYS = (by_octets, by_json, by_value, by_path)

if __name__ == "__main__":
    # The module is C, which counts by itself. Python is not instrumented: all of it was, for 10 s at the start and half of each input.
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
