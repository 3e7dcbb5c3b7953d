"""Encoding of JSON objects to octets, the inverse of decoding.record()."""

import json
from collections.abc import Sequence
from typing import NamedTuple

from board.runtime.errors import RequestError
from drivers.wire.editions import names, of_header
from firmware.codec.library import Message, other_edition, strict_name
from firmware.codec.reading import Object, Pdu, pdu_of, port_of, when_ns
from firmware.topics import JSON_FORMS, PLAIN

_FIELDS = "an object of the fields, as `captain decode` shows"


class Wish(NamedTuple):
    """Requested editions.

    known      candidate messages; with `--edition` only its messages.
    asked      value of `--edition`, or None.
    library    all messages, to recognise the header.
    is_forced  ignore the header.
    is_plain   objects without `form` are in the plain dialect.
    """

    known: Sequence[Message]
    asked: str | None
    library: Sequence[Message]
    is_forced: bool = False
    is_plain: bool = False


class Encoded(NamedTuple):
    """A message and its octets. warning: text if the header contradicts the edition and was accepted, else empty."""

    message: Message
    octets: bytes
    warning: str = ""


def encode(one: Object, wish: Wish) -> Encoded:
    """Encode the message of a JSON object.

    one  {"edition": "cam-1.4.1", "message": {...}}; the message alone if `--edition` or its header gives the edition.
         "form": "plain" is the plain dialect.

    The header selects the edition. Raises RequestError with edition, path, value and range, also if the header
    contradicts the edition.
    """
    if "error" in one.value and "message" not in one.value:
        raise RequestError(
            f"{one.origin}: it is an error of `captain decode`, without a message", "encode what `captain decode` shows"
        )
    edition = one.value.get("edition")
    if edition is not None and not isinstance(edition, str):
        raise RequestError(f"{one.origin}: edition: {edition!r} is not a text")
    edition = wish.asked if edition is None else edition
    value = _message(one)
    messages = _by_name(one, edition, wish) if edition is not None else _by_header(one, value, wish)
    message, octets = _first(messages, value, one.origin, _is_plain(one, wish))
    told = _disagreement(message, octets, wish.library)
    owners = of_header(wish.library, octets)
    if told and owners and not wish.is_forced:
        fits = [other for other in owners if other.type == message.type and not other.form_of]
        remedy_ = f"name {names(fits, 'or')}" if fits else "change the header"
        raise RequestError(f"{one.origin}: {told}", f"{remedy_}, or add --force")
    return Encoded(message, octets, f"{one.origin}: {told}" if told else "")


def _is_plain(one: Object, wish: Wish) -> bool:
    form = one.value.get("form") if "message" in one.value else None
    if form not in (None, *JSON_FORMS):
        known = " or ".join(JSON_FORMS)
        raise RequestError(f"{one.origin}: form: unknown form {json.dumps(form)[:40]}", f"use {known}")
    return wish.is_plain if form is None else form == PLAIN


def pdu_from(item: Pdu | Object, wish: Wish) -> tuple[Pdu, str]:
    """Return the PDU of an item, and a warning or "". Octets of a JSON object come before its fields: they are exact.

    Raises RequestError as encode() and pdu_of() do.
    """
    if isinstance(item, Pdu) or "hex" in item.value or "base64" in item.value or "message" not in item.value:
        return pdu_of(item), ""
    made = encode(item, wish)
    return Pdu(made.octets, item.origin, port_of(item), when_ns(item)), made.warning


def _message(one: Object) -> dict[str, object] | list[object]:
    """Return the fields: the member `message`, or the whole object if it has no `edition`."""
    if "message" not in one.value:
        if one.value.get("edition") is not None:
            raise RequestError(f'{one.origin}: "message" is missing', _FIELDS)
        return one.value
    value = one.value["message"]
    if not isinstance(value, dict | list):
        raise RequestError(f"{one.origin}: message: {json.dumps(value)[:40]} is not an object", _FIELDS)
    return value


def _by_name(one: Object, edition: str, wish: Wish) -> list[Message]:
    """Return the named edition. For a type: its editions that the header announces, else all."""
    exact = [message for message in wish.known if edition.lower() == message.name]
    if wish.asked is not None:  # both forms of a message have the same fields
        strict = strict_name(edition.lower())
        exact = exact or [message for message in wish.known if strict_name(message.name) == strict]
    if exact:
        return exact
    fits = [message for message in wish.known if edition.lower() == message.type and not message.form_of]
    if fits:
        return ([] if wish.is_forced else announced(fits, _message(one))) or fits
    if wish.asked is not None:
        raise RequestError(
            f"{one.origin}: edition: {edition} contradicts --edition {wish.asked}",
            "omit --edition, or edit the object (captain does not convert editions)",
        )
    raise RequestError(f"{one.origin}: edition: unknown edition {edition!r}", other_edition(edition, wish.known))


def _by_header(one: Object, value: object, wish: Wish) -> list[Message]:
    """Return the editions that the header announces, if none is named. The -ext form must be named."""
    strict = [message for message in wish.known if not message.form_of]
    found = [] if wish.is_forced else announced(strict or wish.known, value)
    if found:
        return found
    _, number = _header(value)
    fits = [message.name for message in wish.known if number in message.ids]
    editions = " or ".join(fits or ["cam-1.4.1"])
    raise RequestError(f"{one.origin}: edition is missing", f'add "edition" or pass --edition {editions}')


def announced(messages: Sequence[Message], value: object) -> list[Message]:
    """Return editions with the header's messageID and protocolVersion.

    Those that spell the header in the same way come first.
    """
    version, number = _header(value)
    if version is None or number is None:
        return []
    fits = of_header(messages, bytes((version, number)))
    return sorted(fits, key=lambda message: (not _has_names(message, value), message.rank))


def _header(value: object) -> tuple[int | None, int | None]:
    """Return protocolVersion and messageID of a message in JSON; None if absent.

    Both releases' spellings are accepted.
    """
    header = value.get("header") if isinstance(value, dict) else None
    if not isinstance(header, dict):
        return None, None
    members = {key.lower(): number for key, number in header.items()}
    version, number = (members.get(name) for name in ("protocolversion", "messageid"))
    return _octet(version), _octet(number)


def _octet(number: object) -> int | None:
    return number if isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= 255 else None


def _has_names(message: Message, value: object) -> bool:
    """Return whether the header of a message in JSON is absent or uses the edition's names."""
    if not message.ids:
        return True
    header = value.get("header") if isinstance(value, dict) else None
    return not isinstance(header, dict) or set(_names_of(message)).issuperset(header)


def _names_of(message: Message) -> list[str]:
    """Return the component names of an edition's ITS PDU header. Release 2 spells two of them differently."""
    return [field.name for field in message.type_tree().fields[0].type.fields]


def _first(messages: Sequence[Message], value: object, origin: str, is_plain: bool) -> tuple[Message, bytes]:
    """Encode with the first edition that accepts the fields. Raises RequestError with the error of the first one."""
    refused: RequestError | None = None
    for message in messages:
        try:
            return message, _octets(message, value, origin, is_plain)
        except RequestError as error:
            refused = refused or error
    assert refused is not None
    raise refused


def _disagreement(message: Message, octets: bytes, library: Sequence[Message]) -> str:
    """Return how the ITS PDU header contradicts the edition; empty if it does not. Receivers go by the header."""
    if not message.ids or len(octets) < 2 or of_header([message], octets):
        return ""
    version, number = octets[:2]
    if number not in message.ids:
        types = sorted({other.type for other in library if number in other.ids})
        said = f"announces {' or '.join(types)}" if types else "is unknown"
        return f"{message.name}: header: messageID {number} {said}; {message.type} has {_numbers(message.ids)}"
    return f"{message.name}: header: protocolVersion is {version}, this edition has {_numbers(message.versions)}"


def _numbers(numbers: Sequence[int]) -> str:
    return " or ".join(map(str, numbers))


def _octets(message: Message, value: object, origin: str, is_plain: bool) -> bytes:
    try:
        return message.from_json(json.dumps(value), plain=is_plain)
    except (RecursionError, MemoryError) as error:
        raise RequestError(f"{origin}: {message.name}: it is nested too deeply, or larger than a message") from error
    except ValueError as error:
        path, reason = getattr(error, "path", ""), getattr(error, "reason", str(error))
        hint = ""
        if not _has_names(message, value):
            hint = f"the header of {message.name} has {', '.join(_names_of(message))}"
        raise RequestError(f"{origin}: {message.name}: {path or 'the message'}: {reason}", hint) from error
