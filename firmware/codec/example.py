"""Example messages: a legal message of an edition, with fields given by name."""

from collections.abc import Sequence

from board.runtime.errors import RequestError
from firmware.codec.library import Library, editions
from firmware.codec.reading import Pdu


def example(library: Library, edition: str, fields: Sequence[str]) -> Pdu:
    """Return an example of an edition ("cam-1.4.1"), or of the preferred edition of a type ("cam").

    fields  NAME=VALUE; short names or paths, values in SI units and degrees or as names of special values.

    Raises RequestError for an unknown edition, and with path, value and range for a field.
    """
    editions(library, edition, "--example")
    message = library.find(edition.lower())
    values = dict(_field(text) for text in fields)
    try:
        return Pdu(message.encode(message.example(**values)), f"the example of {message.name}")
    except ValueError as error:
        raise RequestError(f"--example: {error}") from error


def _field(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise RequestError(f"--example: {text!r}: invalid field", "write NAME=VALUE, such as speed=13.9")
    return name, value
