"""The message library as the commands see it: the built module `captain_messages`, imported when it is needed.

Its contract is asn1/README.md. The Protocols say what of it is used here.
"""

from collections.abc import Sequence
from typing import Protocol, cast

from board.describe import remedy
from board.errors import RequestError, StationError
from drivers.wire.v2n_type import Type

FORM = "-ext"  # suffix of the -ext form (asn1/editions.toml, form_of)


class NoLibraryError(StationError):
    """The program was installed without the message library."""


class Step(Protocol):
    """One stretch of bits of a message, or where a container begins or ends.

    what   "value", "enter", "leave", "extension bit", "presence", "length", "choice", "open", "unknown", "padding".
    bit, width  where it begins in the message, and how many bits it has.
    path   "cam.camParameters.basicContainer.stationType".
    type   name of the type in the standard; empty where it has none.
    text   the value as message.text() writes it: "2028 (20.28 m/s)".
    unit   of a value of 1: "0.01 m/s"; empty without one.
    clause  of X.691, whose rule these bits follow.
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

    def decode(self, octets: bytes, /) -> object: ...
    def view(self, octets: bytes, /) -> object: ...
    def encode(self, value: object, /) -> bytes: ...
    def to_json(self, octets: bytes, /) -> str: ...
    def from_json(self, text: str, /) -> bytes: ...
    def validate(self, value: object, /) -> None: ...
    def text(self, octets: bytes, /) -> str: ...
    def leaves(self, octets: bytes, /) -> tuple[bytes, int]: ...
    def explain(self, octets: bytes, /) -> Sequence[Step]: ...
    def type_tree(self) -> Type: ...


class Library(Protocol):
    """The module. What its functions raise is a ValueError with path and reason; on decoding, with bit."""

    def all(self) -> Sequence[Message]: ...
    def find(self, name: str, /) -> Message: ...
    def ros2_plan(self) -> bytes: ...


def load() -> Library:
    """The message library. Raises NoLibraryError."""
    try:
        import captain_messages
    except ImportError as error:
        raise NoLibraryError(
            f"the message library cannot be imported: {error}", "`make codec` builds it and puts it where this is"
        ) from error
    return cast("Library", captain_messages)


def strict_name(edition: str) -> str:
    """Return the name of the strict form of an edition: cpm-2.1.1."""
    return edition.removesuffix(FORM)


def editions(library: Library, asked: str | None) -> list[Message]:
    """The messages that `--edition` names: one edition ("cam-1.4.1"), all of a type ("cam"); without it all.

    Raises RequestError that names what there is.
    """
    known = sorted(library.all(), key=lambda message: (message.type, message.rank))
    if asked is None:
        return known
    chosen = [message for message in known if asked.lower() in (message.name, message.type)]
    if not chosen:
        names = dict.fromkeys([message.type for message in known] + [message.name for message in known])
        raise RequestError(
            f"--edition: unknown edition {asked!r}",
            f"{remedy(asked.lower(), names)}; `captain decode --list` shows them all",
        )
    return chosen
