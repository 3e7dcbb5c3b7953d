"""JSON objects to octets: the way back from decoding.record()."""

import json
from collections.abc import Sequence

from board.describe import remedy
from board.errors import RequestError
from firmware.codec.library import Message
from firmware.codec.reading import Object

_FIELDS = "an object of the fields, as `captain decode` shows"


def encode(one: Object, known: Sequence[Message], asked: str | None) -> tuple[Message, bytes]:
    """The message that an object says it is, and its octets.

    one    {"edition": "cam-1.4.1", "message": {...}}, or with `asked` the message alone.
    known  the messages of the library, those of `--edition` where that was given.
    asked  what `--edition` says.

    Raises RequestError that names edition, path, value and range.
    """
    edition = one.value.get("edition")
    if edition is None and "error" in one.value and "message" not in one.value:
        raise RequestError(
            f"{one.origin}: it did not decode, so it has no message", "encode what `captain decode` shows"
        )
    if edition is None and asked is None:
        raise RequestError(f'{one.origin}: it has no "edition"', _editions_by_header(one.value, known))
    if edition is not None and not isinstance(edition, str):
        raise RequestError(f"{one.origin}: edition: {edition!r} is no text")
    message = _chosen(one, edition if edition is not None else str(asked), known, asked)
    is_alone = edition is None and "message" not in one.value
    if not is_alone and "message" not in one.value:
        raise RequestError(f'{one.origin}: it has no "message"', _FIELDS)
    value = one.value if is_alone else one.value["message"]
    if not isinstance(value, dict | list):
        raise RequestError(f"{one.origin}: message: {json.dumps(value)[:40]} is no object", _FIELDS)
    return message, _octets(message, value, one.origin)


def disagreement(message: Message, octets: bytes, known: Sequence[Message]) -> str:
    """How the ITS PDU header of an encoded message contradicts its edition, else empty. Receivers go by the header.

    known  the messages of the library: what the header announces instead is looked for among them.
    """
    if not message.ids or len(octets) < 2:
        return ""
    version, number = octets[:2]
    if number not in message.ids:
        names = sorted({other.type for other in known if number in other.ids})
        said = f"announces {' or '.join(names)}" if names else "announces no message of the library"
        return f"{message.name}: header: messageID {number} {said}, {message.type} has {_numbers(message.ids)}"
    if version not in message.versions:
        return f"{message.name}: header: protocolVersion is {version}, this edition has {_numbers(message.versions)}"
    return ""


def _numbers(numbers: Sequence[int]) -> str:
    return " or ".join(map(str, numbers))


def _chosen(one: Object, edition: str, known: Sequence[Message], asked: str | None) -> Message:
    """The edition; of a type alone the preferred one."""
    fits = [message for message in known if edition.lower() in (message.name, message.type)]
    if fits:
        return min(fits, key=lambda message: message.rank)
    if asked is not None:
        raise RequestError(
            f"{one.origin}: edition: {edition} is not {asked}",
            "editions are not converted into each other: leave out --edition, or change the object's",
        )
    names = [message.name for message in known]
    raise RequestError(f"{one.origin}: edition: {edition!r} is no message of the library", remedy(edition, names))


def _octets(message: Message, value: object, origin: str) -> bytes:
    try:
        return message.from_json(json.dumps(value))
    except (RecursionError, MemoryError) as error:
        raise RequestError(f"{origin}: {message.name}: it is nested too deeply, or larger than a message") from error
    except ValueError as error:
        path, reason = getattr(error, "path", ""), getattr(error, "reason", str(error))
        raise RequestError(f"{origin}: {message.name}: {path or 'the message'}: {reason}") from error


def _editions_by_header(value: dict[str, object], known: Sequence[Message]) -> str:
    """What to write, where the object looks like a message with an ITS PDU header."""
    header = value.get("header")
    members = {key.lower(): number for key, number in header.items()} if isinstance(header, dict) else {}
    fits = [message.name for message in known if members.get("messageid") in message.ids]
    names = " or ".join(fits or ["cam-1.4.1"])
    return f"say which: --edition {names}"
