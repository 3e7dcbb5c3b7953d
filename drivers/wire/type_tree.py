"""Types of the message library, as returned by type_tree() of asn1/guide/python-functions.md."""

from collections.abc import Sequence
from typing import Protocol


class Field(Protocol):
    """Component of a SEQUENCE, or alternative of a CHOICE; addition is 0 for those in the extension root."""

    @property
    def name(self) -> str: ...
    @property
    def type(self) -> "Type": ...
    @property
    def addition(self) -> int: ...


class Type(Protocol):
    """Type of the message library.

    low, high  smallest and largest value, or size, in the extension root; None: no bound.
    names      named numbers, items or bits, with their values.
    rows       types of an open type, with their identifiers.
    """

    @property
    def name(self) -> str | None: ...
    @property
    def kind(self) -> str: ...
    @property
    def low(self) -> int | None: ...
    @property
    def high(self) -> int | None: ...
    @property
    def names(self) -> Sequence[tuple[str, int]]: ...
    @property
    def fields(self) -> Sequence[Field]: ...
    @property
    def element(self) -> "Type | None": ...
    @property
    def rows(self) -> "Sequence[tuple[int, Type]]": ...
    def __hash__(self) -> int: ...
