"""ETSI ITS messages: encode, decode, validate, inspect.

Classes whose names begin with a module key (r1_cam_CAM, r1_cam_CAM_View) are known to type checkers only:
import them under `if TYPE_CHECKING`.
"""

from collections.abc import Iterator
from typing import Any, Generic, Literal, NamedTuple, TypeAlias, TypeVar, overload

Octets: TypeAlias = bytes | bytearray | memoryview
_D = TypeVar("_D")
_V = TypeVar("_V")

class DecodeError(ValueError):
    """Octets that are no such message. path: of the bad value, without the PDU's name; bit: offset of its first bit."""

    path: str
    bit: int
    reason: str

class EncodeError(ValueError):
    """A value that is no such message."""

    path: str
    reason: str

class ValidateError(ValueError):
    """A message that breaks a constraint of its standard."""

    path: str
    reason: str

class View(Generic[_D]):
    """A part of a message, whose values are made when they are touched. Holds the memory of the whole message."""

    def to_dict(self) -> _D: ...

class RecordView(View[_D]):
    """A SEQUENCE: its components are attributes (a-b is a_b, class is class_), absent ones are None."""

class ChoiceView(View[_D], Generic[_D, _V]):
    """A CHOICE."""

    @property
    def choice(self) -> str: ...
    @property
    def value(self) -> _V: ...

class ListView(View[list[_D]], Generic[_D, _V]):
    """A SEQUENCE OF; slices are lists."""

    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int, /) -> _V: ...
    @overload
    def __getitem__(self, index: slice, /) -> list[_V]: ...
    def __iter__(self) -> Iterator[_V]: ...
    def __reversed__(self) -> Iterator[_V]: ...
    def __contains__(self, value: object, /) -> bool: ...

class Step(NamedTuple):
    """What some bits of a message say. Containers are entered and left; clause: of ITU-T X.691."""

    what: Literal[
        "value", "enter", "leave", "extension bit", "presence", "length", "choice", "open", "unknown", "padding"
    ]
    bit: int
    width: int
    path: str
    name: str
    type: str
    text: str
    unit: str
    clause: str

class Field(NamedTuple):
    """A component of a SEQUENCE, an alternative of a CHOICE. addition: 0 in the root, k for the k-th addition."""

    name: str
    type: Type
    unit: str | None
    is_optional: bool
    default: Any
    addition: int

class Type:
    """A type of the ASN.1. low, high: smallest and largest value, or size, of the root; None: no bound."""

    @property
    def name(self) -> str | None: ...
    @property
    def kind(self) -> str: ...
    @property
    def unit(self) -> str | None: ...
    @property
    def standard(self) -> str | None: ...
    @property
    def low(self) -> int | None: ...
    @property
    def high(self) -> int | None: ...
    @property
    def is_extensible(self) -> bool: ...
    @property
    def names(self) -> tuple[tuple[str, int], ...]: ...
    @property
    def fields(self) -> tuple[Field, ...]: ...
    @property
    def element(self) -> Type | None: ...
    @property
    def rows(self) -> tuple[tuple[int, Type], ...]: ...

class Message(Generic[_D, _V]):
    """One PDU of one edition of a standard."""

    name: str
    type: str
    release: int
    standard: str
    module: str
    pdu: str
    ids: tuple[int, ...]
    versions: tuple[int, ...]
    btp_port: int
    rank: int
    is_experimental: bool

    def decode(self, octets: Octets, /) -> _D: ...
    def view(self, octets: Octets, /) -> _V: ...
    def encode(self, value: _D | _V, /) -> bytes: ...
    def validate(self, value: _D | _V | Octets, /) -> None: ...
    def to_json(self, octets: Octets, /) -> str: ...
    def from_json(self, text: str | bytes, /) -> bytes: ...
    def text(self, octets: Octets, /) -> str: ...
    def explain(self, octets: Octets, /) -> list[Step]: ...
    def type_tree(self) -> Type: ...

def all() -> tuple[Message[Any, Any], ...]: ...  # noqa: A001
