"""Encoding of a user's JSON: chooses the edition, completes the message, and lists all its faults."""

import json
from collections.abc import Sequence

from board.runtime.describe import remedy
from board.runtime.errors import RequestError
from drivers.message import Fault
from drivers.wire.editions import of_header
from firmware.codec.library import Library, Message
from firmware.facilities import strict_json
from firmware.facilities.completing import Completion, replace_at, stand_in, type_at, value_at
from firmware.facilities.exchange import Ask
from firmware.topics import JSON_FORMS, PLAIN

TOLD = 3  # number of faults in the text of an error
MOST_FAULTS = 50  # largest number of faults that are listed
# Members of an object that a station publishes.
MEMBERS = frozenset({"edition", "form", "message", "reception", "type", "warning", "others"})


class FaultsError(RequestError):
    """A message that cannot be encoded, with all faults that were found."""

    def __init__(self, what: str, faults: Sequence[Fault]) -> None:
        told = [f"{path or 'the message'}: {problem}" for path, problem, _ in faults[:TOLD]]
        if len(faults) > TOLD:
            told.append(f"and {len(faults) - TOLD} more faults")
        super().__init__(f"{what}: {'; '.join(told)}")
        self.faults = tuple(faults[:MOST_FAULTS])


class Encoder:
    """Encodes requests of users.

    library  the message library.
    """

    def __init__(self, library: Library) -> None:
        self._messages = sorted(library.all(), key=lambda message: (message.type, message.rank))

    def encode(self, ask: Ask) -> bytes:
        """Return the octets of a request. Raises FaultsError with all its faults."""
        try:
            found = strict_json.parse(ask.body)
        except ValueError as error:
            raise FaultsError("JSON", [("", str(error), None)]) from error
        if faults := list(strict_json.faults(found)):
            raise FaultsError("JSON", faults)
        if not isinstance(found, dict):
            raise FaultsError("JSON", [("", "not an object", None)])
        value = found
        if "message" in found:
            if strange := [key for key in found if key not in MEMBERS]:
                raise FaultsError("JSON", [(key, "unknown member", None) for key in strange])
            value = found["message"]
            if not isinstance(value, dict):
                raise FaultsError("JSON", [("message", "not an object", value)])
            form = found.get("form", ask.form)
            if form not in JSON_FORMS:
                raise FaultsError("JSON", [("form", f"unknown form; {' or '.join(JSON_FORMS)}", form)])
            ask = ask._replace(form=form)
        message = self._message(ask, found.get("edition") if "message" in found else None, value)
        return _encode(message, ask, value)

    def _message(self, ask: Ask, edition: object, value: dict[str, object]) -> Message:
        """Return the edition that the user names, or that the header announces, or the preferred one of the type."""
        if edition is not None:
            fits = [one for one in self._messages if edition in (one.name, one.type)]
            if not fits:
                names = [one.name for one in self._messages]
                raise FaultsError("JSON", [("edition", f"unknown edition; {remedy(str(edition), names)}", edition)])
        else:
            fits = [one for one in self._messages if not one.form_of]
        if ask.type:
            of_type = [one for one in fits if one.type == ask.type]
            if not of_type:
                problem = f"the envelope is v2x.{ask.type}." if edition else f"no message of type {ask.type} is known"
                raise FaultsError("JSON", [("edition", problem, edition)])
            fits = of_type
        announced = of_header(fits, _header(value))
        if not announced and edition is None and not ask.type:
            raise FaultsError("JSON", [("edition", "missing: edition, header, or type in the envelope", None)])
        return (announced or fits)[0]


def _header(value: dict[str, object]) -> bytes:
    header = value.get("header")
    if not isinstance(header, dict):
        return b""
    octets = [header.get(name) for name in ("protocolVersion", "messageID" if "messageID" in header else "messageId")]
    return bytes(one for one in octets if isinstance(one, int) and 0 <= one <= 255)


def _encode(message: Message, ask: Ask, value: dict[str, object]) -> bytes:
    completion = Completion(message, ask)
    completed = completion.complete(value)
    faults = completion.faults
    made = _octets(message, ask.form, completed)
    while isinstance(made, ValueError) and len(faults) < MOST_FAULTS:
        # The library reports the first invalid value. With a legal one in its place, it reports the next.
        path, reason = getattr(made, "path", ""), getattr(made, "reason", str(made))
        if path not in {known for known, _, _ in faults}:
            faults.append((path, reason, value_at(completed, path)))
        kind = type_at(message.type_tree(), path)
        legal = None if kind is None else stand_in(kind, ask.form)
        if legal is None or value_at(completed, path) == legal or not replace_at(completed, path, legal):
            break
        made = _octets(message, ask.form, completed)
    if faults or isinstance(made, ValueError):
        raise FaultsError(message.name, faults)
    return made


def _octets(message: Message, form: str, value: object) -> bytes | ValueError:
    text = json.dumps(value)
    try:
        return message.from_json(text, plain=True) if form == PLAIN else message.from_json(text)
    except ValueError as error:
        return error
