"""The Python module under atheris: any octets, any JSON, any value, and only the errors that it promises."""

import contextlib
import json
import sys
from typing import Any

import atheris
import captain_messages as messages

ALL = messages.all()


def one_input(octets: bytes) -> None:
    """The first octet chooses the message, the second the way in."""
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
    for again in (
        message.encode(value),
        message.encode(message.view(octets)),
        message.from_json(message.to_json(octets)),
    ):
        assert message.decode(again) == value
    assert message.view(octets).to_dict() == value
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
    atheris.instrument_all()
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
