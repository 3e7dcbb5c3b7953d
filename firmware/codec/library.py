"""Message library: imports the built module `captain_messages` on demand.

The Protocols contain the members that are used here. The full interface is in asn1/guide/python-functions.md.
"""

import os
from collections.abc import Mapping, Sequence
from typing import Protocol, cast

from board.runtime.describe import remedy
from board.runtime.errors import RequestError, StationError
from drivers.wire.type_tree import Type

FORM = "-ext"  # suffix of the -ext form (asn1/editions.toml, form_of)


class NoLibraryError(StationError):
    """The message library is not installed."""


class Step(Protocol):
    """Consecutive bits of a message with one meaning, or the begin or end of a container.

    The kind `what` is "value", "enter", "leave", "extension bit", "presence", "length", "choice", "open", "unknown" or
    "padding".

    bit, width  offset in the message and number of bits.
    path   "cam.camParameters.basicContainer.stationType".
    type   name of the type in the standard; empty without a name.
    text   the value as message.text() writes it: "2028 (20.28 m/s)".
    unit   unit of the value: "0.01 m/s"; empty without one.
    clause  clause of X.691 for these bits.
    """

    @property
    def what(self) -> str: ...
    @property
    def bit(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def path(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def clause(self) -> str: ...


class Message(Protocol):
    """A message of one edition of its standard.

    form_of  name of the message of which this is the -ext form; "" for the strict form.
    short_names  path of each field with a short name.
    """

    @property
    def name(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def release(self) -> int: ...
    @property
    def standard(self) -> str: ...
    @property
    def ids(self) -> Sequence[int]: ...
    @property
    def versions(self) -> Sequence[int]: ...
    @property
    def btp_port(self) -> int: ...
    @property
    def rank(self) -> int: ...
    @property
    def is_experimental(self) -> bool: ...
    @property
    def form_of(self) -> str: ...
    @property
    def short_names(self) -> Mapping[str, str]: ...

    def decode(self, octets: bytes, /) -> object: ...
    def view(self, octets: bytes, /) -> object: ...
    def encode(self, value: object, /) -> bytes: ...
    def to_json(self, octets: bytes, /, *, plain: bool = False) -> str: ...
    def from_json(self, text: str, /, *, plain: bool = False) -> bytes: ...
    def validate(self, value: object, /) -> None: ...
    def text(self, octets: bytes, /) -> str: ...
    def leaves(self, octets: bytes, /) -> tuple[bytes, int]: ...
    def explain(self, octets: bytes, /) -> Sequence[Step]: ...
    def type_tree(self) -> Type: ...
    def example(self, **fields: object) -> object: ...


class Library(Protocol):
    """Interface of the module.

    Its functions raise ValueErrors with path and reason; those of decoding also with bit.
    """

    def all(self) -> Sequence[Message]: ...
    def find(self, name: str, /) -> Message: ...
    def ros2_plan(self) -> bytes: ...


def load() -> Library:
    """Load the message library. Raises NoLibraryError if it cannot be imported."""
    try:
        import captain_messages
    except ImportError as error:
        raise NoLibraryError(
            f"the message library cannot be imported: {error}", "`make codec` builds it and puts it where this is"
        ) from error
    return cast("Library", captain_messages)


def breaks_constraint(error: ValueError) -> bool:
    """Return True if the error of a value is a constraint between its components, not one component."""
    import captain_messages

    return isinstance(error, captain_messages.ValidateError)


def stamp() -> tuple[int, int] | None:
    """Return inode and time of the last change of the file of the module; None without a file."""
    import importlib.util

    try:
        found = importlib.util.find_spec("captain_messages")
        if found is None or found.origin is None:
            return None
        file = os.stat(found.origin)
    except OSError:
        return None
    return file.st_ino, file.st_mtime_ns


def strict_name(edition: str) -> str:
    """Return the name of the strict form of an edition: cpm-2.1.1."""
    return edition.removesuffix(FORM)


def editions(library: Library, asked: str | None, option: str = "--edition") -> list[Message]:
    """Return the messages that an option selects, sorted by type and rank.

    asked   an edition ("cam-1.4.1"), or a type ("cam") for all its editions; None for all messages.
    option  name of the option, for the error.

    Raises RequestError for an unknown name, with the known ones.
    """
    known = sorted(library.all(), key=lambda message: (message.type, message.rank))
    if asked is None:
        return known
    chosen = [message for message in known if asked.lower() in (message.name, message.type)]
    if not chosen:
        told = other_edition(asked, known, list(dict.fromkeys(message.type for message in known)))
        raise RequestError(f"{option}: unknown edition {asked!r}", f"{told}; `captain decode --list` shows them all")
    return chosen


def other_edition(asked: str, known: Sequence[Message], types: Sequence[str] = ()) -> str:
    """Return the remedy for an unknown edition: a similar edition of its type, or all of them; else a similar name.

    types  names of types that may be written in place of an edition.
    """
    asked = asked.lower()
    names = [one.name for one in known]
    of_type = [one.name for one in known if asked.startswith(f"{one.type}-")]
    return remedy(asked, of_type or [*types, *names])
