"""Encoding of a user's JSON: chooses the edition, completes the message, and lists all its faults."""

import json
from collections.abc import Sequence
from typing import NamedTuple

from board.runtime.errors import RequestError
from drivers.message import Fault
from drivers.wire.editions import of_header
from firmware.codec.encoding import announced
from firmware.codec.library import Library, Message, other_edition
from firmware.facilities import strict_json
from firmware.facilities.completing import Completion, stand_in
from firmware.facilities.exchange import Ask
from firmware.facilities.named_fields import from_fields
from firmware.facilities.paths import remove_at, replace_at, type_at, value_at
from firmware.topics import JSON_FORMS, PLAIN, type_name

TOLD = 3  # number of faults in the text of an error
MOST_FAULTS = 50  # largest number of faults that are listed
MOST_FIELDS = 256  # largest number of fields of a message that is given by fields: each fault takes another trial
LONGEST = 200  # characters of a path, a problem or a value: all faults then fit into one message to the station
# Members beside the message, of an object that the station publishes or `captain decode --json` prints.
MEMBERS = frozenset({
    "edition", "fields", "form", "message", "reception", "type", "warning", "others",
    "why", "candidates", "origin", "octets", "btp_port", "received", "carried", "is_exact", "hex",
})  # fmt: skip


class Encoded(NamedTuple):
    """Octets of a message, and its type as in envelopes."""

    octets: bytes
    type: str


class FaultsError(RequestError):
    """A message that cannot be encoded, with all faults that were found."""

    def __init__(self, what: str, faults: Sequence[Fault]) -> None:
        self.faults = tuple(map(_short, faults[:MOST_FAULTS]))
        told = [f"{path or 'the message'}: {problem}" for path, problem, _ in self.faults[:TOLD]]
        if len(faults) > TOLD:
            told.append(f"and {len(faults) - TOLD} more faults")
        super().__init__(f"{what}: {'; '.join(told)}")


class Encoder:
    """Encodes requests of users.

    library  the message library.
    """

    def __init__(self, library: Library) -> None:
        self._messages = sorted(library.all(), key=lambda message: (message.type, message.rank))

    def encode(self, ask: Ask) -> Encoded:
        """Encode a request. Raises FaultsError with all its faults."""
        try:
            found = strict_json.parse(ask.body)
        except ValueError as error:
            raise _fault("", str(error)) from error
        if faults := list(strict_json.faults(found)):
            raise FaultsError("JSON", faults)
        if not isinstance(found, dict):
            raise _fault("", "not an object")
        if "fields" in found:
            return self._encode_fields(ask, found)
        if "message" not in found:
            message = self._message(ask, None, found)
            return Encoded(_encode(message, ask, found), type_name(message.type))
        if strange := [key for key in found if key not in MEMBERS]:
            raise FaultsError("JSON", [(key, "unknown member", None) for key in strange])
        value, form = found["message"], found.get("form", ask.form)
        if not isinstance(value, dict):
            raise _fault("message", "not an object", value)
        if form not in JSON_FORMS:
            raise _fault("form", f"unknown form; {' or '.join(JSON_FORMS)}", form)
        message = self._message(ask, found.get("edition"), value)
        return Encoded(_encode(message, ask._replace(form=form), value), type_name(message.type))

    def _encode_fields(self, ask: Ask, found: dict[str, object]) -> Encoded:
        """Encode a message that is given by fields, in SI units and degrees."""
        if strange := [key for key in found if key not in ("edition", "fields")]:
            raise FaultsError("JSON", [(key, "not allowed beside fields", None) for key in strange])
        fields = found["fields"]
        if not isinstance(fields, dict):
            raise _fault("fields", "not an object", fields)
        if len(fields) > MOST_FIELDS:
            raise _fault("fields", f"{len(fields)} fields; at most {MOST_FIELDS}: send `message`")
        message = self._message(ask, found.get("edition"), {})
        value, faults = from_fields(message, fields)
        return Encoded(_encode(message, ask._replace(form=PLAIN), value, faults), type_name(message.type))

    def _message(self, ask: Ask, edition: object, value: dict[str, object]) -> Message:
        """Return the edition that the user names, or that the header announces, or the preferred one of the type."""
        if edition is None:
            fits = [one for one in self._messages if not one.form_of]
        elif not (fits := [one for one in self._messages if edition in (one.name, one.type)]):
            told = other_edition(str(edition)[:LONGEST], self._messages)
            raise _fault("edition", f"unknown edition; {told}", edition)
        if ask.type:
            of_type = [one for one in fits if type_name(one.type) == ask.type]
            if not of_type:
                is_named = edition is not None
                known = f"the envelope is v2x.{ask.type}." if is_named else f"no message of type {ask.type} is known"
                raise _fault("edition", known, edition)
            fits = of_type
        of_this = announced(fits, value)
        if not of_this and edition is None and not ask.type:
            raise _fault("edition", "missing: edition, header, or type in the envelope")
        return (of_this or fits)[0]


def _fault(path: str, problem: str, value: object = None) -> FaultsError:
    return FaultsError("JSON", [(path, problem, value)])


def _short(fault: Fault) -> Fault:
    """Return a fault without long texts, and without a value that contains others."""
    path, problem, value = fault
    if isinstance(value, str):
        value = value[:LONGEST]
    elif isinstance(value, dict | list) or (isinstance(value, int) and abs(value) >= 2**64):
        value = f"({type(value).__name__})"
    return path[:LONGEST], problem[:LONGEST], value


def _encode(message: Message, ask: Ask, value: dict[str, object], known: Sequence[Fault] = ()) -> bytes:
    completion = Completion(message, ask)
    completed = completion.complete(value)
    faults = [*known, *completion.faults]
    made = _octets(message, ask.form, completed)
    while isinstance(made, ValueError) and len(faults) < MOST_FAULTS:
        # The library reports the first invalid value, and the next one when the first is replaced or removed.
        path, reason = getattr(made, "path", ""), getattr(made, "reason", str(made))
        if path not in {told for told, _, _ in faults}:
            faults.append((path, reason, value_at(completed, path)))
        kind, invalid = type_at(message.type_tree(), path), value_at(completed, path)
        legal = None if kind is None else stand_in(kind, ask.form)
        is_same = type(invalid) is type(legal) and invalid == legal
        is_changed = remove_at(completed, path) if legal is None else replace_at(completed, path, legal)
        made = _octets(message, ask.form, completed)
        if is_same or not is_changed or getattr(made, "path", "") == path:
            break
    if faults or isinstance(made, ValueError):
        raise FaultsError(message.name, faults)
    if message.ids and not of_header([message], made):
        problem = f"messageID {made[1]} and protocolVersion {made[0]} are not those of {message.name}"
        raise FaultsError(message.name, [("header", problem, None)])
    return made


def _octets(message: Message, form: str, value: object) -> bytes | ValueError:
    try:
        text = json.dumps(value)
        return message.from_json(text, plain=form == PLAIN)
    except (RecursionError, MemoryError):
        return ValueError("nested too deeply, or larger than a message")
    except ValueError as error:
        return error
