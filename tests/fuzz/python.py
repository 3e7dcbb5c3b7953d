"""The Python module under atheris: any octets, any JSON, any value, and only the errors that it promises.

Text, explanation and JSON take most of the time. With the argument --every=N they are asked for one input in N, which the octets alone
choose; without it for every input, so what --every=N has found shows again without it.
"""

import contextlib
import json
import sys
import zlib
from typing import Any

import atheris
import captain_messages as messages

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
    # Not the same octets each time: a view and JSON keep a bitmap of additions that are all absent, a dict does not.
    view = message.view(octets)
    assert message.decode(message.encode(value)) == value
    assert message.decode(message.encode(view)) == value
    assert view.to_dict() == value
    if zlib.crc32(octets) % EVERY == 0:
        assert message.decode(message.from_json(message.to_json(octets))) == value
        message.text(octets)
        message.explain(octets)


def by_json(message: Any, octets: bytes) -> None:
    with contextlib.suppress(messages.EncodeError, UnicodeError):
        message.from_json(octets.decode("utf-8", "surrogateescape"))


def by_value(message: Any, octets: bytes) -> None:
    try:
        value = json.loads(octets)
    except (ValueError, RecursionError):
        value = octets
    try:
        message.encode(value)
    except messages.EncodeError as error:
        assert error.reason


WAYS = (by_octets, by_json, by_value)

if __name__ == "__main__":
    # The module is C, which counts by itself. Python is not instrumented: all of it was, for 10 s at the start and half of each input.
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
