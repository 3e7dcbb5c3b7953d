"""Profiles of brokers: loads shipped and users' TOML files, and the message library that decodes payloads."""

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from board.runtime import describe
from board.runtime.errors import BlockedError, ConfigurationError
from drivers.wire.editions import NAMES, compared, of_header
from drivers.wire.editions import names as names_of
from drivers.wire.v2n.description import ProfileDescription
from drivers.wire.v2n.message import Codec, Edition

FOLDER = Path(__file__).parent / "profiles"
TEMPLATE = FOLDER / "template.toml"  # explains each key; it is a valid profile itself


def names() -> list[str]:
    """Return the names of the shipped profiles, without the template."""
    return sorted(path.stem for path in FOLDER.glob("*.toml") if path != TEMPLATE)


def is_file(name: str) -> bool:
    """Return whether the option `profile` is the path of a file, not the name of a shipped profile."""
    return "/" in name or name.endswith(".toml")


def load(name: str) -> ProfileDescription:
    """Load a profile by its name, or by the path of a TOML file.

    Raises ConfigurationError if it is unknown or invalid.
    """
    if name in names():
        path = FOLDER / f"{name}.toml"
    elif is_file(name):
        path = Path(name)
    else:
        hint = f"{describe.remedy(name, names())}; the path of a profile of your own ends in .toml"
        raise ConfigurationError(f"profile: unknown profile {name!r}", hint)
    return describe.read(ProfileDescription, describe.load(path), str(path))


def check_editions(profile: str, editions: Sequence[str]) -> None:
    """Check the option `editions`.

    profile  option `profile`. A user's own file is read only in the process, so its use of editions is checked there.

    Raises ConfigurationError for an unknown edition, and for any edition if a shipped profile never encodes.
    """
    for name in editions:
        if name not in NAMES:
            alike = [known for known in NAMES if known.split("-")[0] == name.split("-")[0]]
            raise ConfigurationError(f"editions: unknown edition {name!r}", f"one of {', '.join(alike or NAMES)}")
    if editions and profile in names():
        _check_encodes(load(profile), editions)


def _check_encodes(description: ProfileDescription, editions: Sequence[str]) -> None:
    if editions and not description.may_decode:
        what = f"editions: option without effect: profile {description.name} never encodes messages"
        raise ConfigurationError(what, "remove the key, or choose a profile with JSON")


def codec(description: ProfileDescription, editions: Sequence[str] = ()) -> Codec | None:
    """Return the message library for a profile.

    None if the profile does not use the library, or if the library is optional for it and missing.

    editions  editions that JSON payloads are encoded in, preferred to all others of their type. They also decide if
              two editions decode a PDU to different values.

    Raises BlockedError if the profile needs the library and it cannot be imported. Raises ConfigurationError for
    editions with a profile that never encodes.
    """
    _check_encodes(description, editions)
    if not description.may_decode:
        return None
    try:
        import captain_messages
    except ImportError as error:
        if not description.needs_codec:
            return None
        what = f"profile {description.name} decodes messages, but the message library cannot be imported: {error}"
        raise BlockedError(what, "`make codec` builds it") from error
    return MessageLibrary(captain_messages.all(), editions)


def library_file() -> str:
    """Return the path of the message library, empty if missing. Does not import it."""
    found = find_spec("captain_messages")
    return found.origin or "" if found else ""


class MessageLibrary:
    """Codec by the editions of captain_messages, selected by the ITS PDU header.

    messages  all editions.
    chosen    names of editions that are preferred for encoding. They also decide between editions that decode a PDU to
              different values. The -ext form of a message (form_of) is only encoded if it is among them.
    """

    def __init__(self, messages: Sequence[Any], chosen: Sequence[str] = ()) -> None:
        self._messages = sorted((message for message in messages if message.ids), key=lambda message: message.rank)
        self._chosen = first = [message for name in chosen for message in self._messages if message.name == name]
        self._encoded = [*first, *(one for one in self._messages if one not in first and not one.form_of)]

    def decodings(self, pdu: bytes) -> Iterator[tuple[Edition, dict[str, Any]]]:
        """Yield editions with the decoded PDU, by preference.

        Candidates are the editions that the header announces; if it announces none, all editions of its messageID. If
        some candidates encode the decoded PDU to the same octets again, only those are used. If two of them decode to
        different values, only the first chosen one is used.

        Raises ValueError if no candidate can decode the PDU, or if the values differ and none of them is chosen.
        """
        messages = of_header(self._messages, pdu) or [one for one in self._messages if pdu[1] in one.ids]
        decoded, failed = {}, ValueError(f"unknown messageID {pdu[1]}")
        for message in reversed(messages):
            try:
                decoded[message] = message.encode(message.view(pdu)) == pdu
            except ValueError as error:
                failed = error
        if not decoded:
            raise failed
        fits = [message for message in messages if message in decoded]
        exact = [message for message in fits if decoded[message]]
        ordered, others = compared(exact or fits, pdu)
        if others:
            rivals = [ordered[0], *others]
            ordered = [message for message in self._chosen if message in rivals][:1]
            if not ordered:
                raise ValueError(f"ambiguous edition: {names_of(rivals)} decode it to different values")
        for message in ordered:
            yield message, message.decode(pdu)

    def editions(self, kind: str) -> Sequence[Edition]:
        number = int(kind) if kind.isdecimal() and len(kind) <= 3 else None
        return [message for message in self._encoded if message.type == kind or number in message.ids]
