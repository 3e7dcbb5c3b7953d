"""The profiles that ship, and those of users: TOML files; and the message library, for those that decode."""

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from board import describe
from board.errors import BlockedError, ConfigurationError
from drivers.wire.v2n_description import ProfileDescription
from drivers.wire.v2n_message import Codec, Edition

FOLDER = Path(__file__).parent / "profiles"
TEMPLATE = FOLDER / "template.toml"  # explains each key; it is one itself


def names() -> list[str]:
    """The profiles that ship."""
    return sorted(path.stem for path in FOLDER.glob("*.toml") if path != TEMPLATE)


def is_file(name: str) -> bool:
    """Whether it is the path of a profile, not the name of one that ships."""
    return "/" in name or name.endswith(".toml")


def load(name: str) -> ProfileDescription:
    """A profile by its name, or by the path of a TOML file. Raises ConfigurationError."""
    if name in names():
        path = FOLDER / f"{name}.toml"
    elif is_file(name):
        path = Path(name)
    else:
        hint = f"{describe.remedy(name, names())}; the path of a profile of your own ends in .toml"
        raise ConfigurationError(f"profile: there is no {name!r}", hint)
    return describe.read(ProfileDescription, describe.load(path), str(path))


def codec(description: ProfileDescription) -> Codec | None:
    """The message library, if the profile needs it. Raises BlockedError where it cannot be imported."""
    if not description.needs_codec:
        return None
    try:
        import captain_messages
    except ImportError as error:
        what = f"profile {description.name} decodes, and the message library cannot be imported: {error}"
        raise BlockedError(what, "`make codec` builds it") from error
    return MessageLibrary(captain_messages.all())


def library_file() -> str:
    """Where the message library is; empty: there is none. Does not import it."""
    found = find_spec("captain_messages")
    return found.origin or "" if found else ""


class MessageLibrary:
    """The editions of captain_messages, chosen by the ITS PDU header."""

    def __init__(self, messages: Sequence[Any]) -> None:
        self._messages = sorted((message for message in messages if message.ids), key=lambda message: message.rank)

    def decodings(self, pdu: bytes) -> Iterator[tuple[Edition, dict[str, Any]]]:
        """Editions of its protocolVersion come first, then those of a lower rank."""
        announced = [message for message in self._messages if pdu[1] in message.ids]
        failed: ValueError | None = ValueError(f"messageID {pdu[1]} is of no message of the library")
        for at, message in enumerate(sorted(announced, key=lambda message: pdu[0] not in message.versions)):
            try:
                value = message.decode(pdu)
            except ValueError as error:
                failed = error if at == 0 else failed
            else:
                failed = None
                yield message, value
        if failed:
            raise failed

    def editions(self, kind: str) -> Sequence[Edition]:
        number = int(kind) if kind.isdecimal() and len(kind) <= 3 else None
        return [message for message in self._messages if message.type == kind or number in message.ids]
