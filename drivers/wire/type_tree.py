"""Types of the message library, as returned by type_tree() of asn1/guide/python-functions.md."""

from collections.abc import Sequence
from typing import Protocol


class Field(Protocol):
    """Component of a SEQUENCE, or alternative of a CHOICE.

    unit         unit of the component if it differs from its type's.
    is_optional  may be absent.
    default      value that an absent component has; None without one.
    addition     0 in the extension root.
    """

    @property
    def name(self) -> str: ...
    @property
    def type(self) -> "Type": ...
    @property
    def unit(self) -> str | None: ...
    @property
    def is_optional(self) -> bool: ...
    @property
    def default(self) -> object: ...
    @property
    def addition(self) -> int: ...


class Type(Protocol):
    """Type of the message library.

    unit       unit of the value 1, such as "0.01 m/s"; None without one.
    low, high  smallest and largest value, or size, in the extension root; None: no bound.
    names      named numbers, items or bits, with their values.
    special    names of special values, such as "unavailable".
    rows       types of an open type, with their identifiers.
    """

    @property
    def name(self) -> str | None: ...
    @property
    def kind(self) -> str: ...
    @property
    def unit(self) -> str | None: ...
    @property
    def low(self) -> int | None: ...
    @property
    def high(self) -> int | None: ...
    @property
    def is_extensible(self) -> bool: ...
    @property
    def names(self) -> Sequence[tuple[str, int]]: ...
    @property
    def special(self) -> Sequence[str]: ...
    @property
    def fields(self) -> Sequence[Field]: ...
    @property
    def element(self) -> "Type | None": ...
    @property
    def rows(self) -> "Sequence[tuple[int, Type]]": ...
    def plain_range(self, unit: str | None, /) -> tuple[str | None, str | None, str]:
        """Return the lowest and highest number in the plain dialect as JSON, and their unit; unit: of the component."""
        ...

    def __hash__(self) -> int: ...
