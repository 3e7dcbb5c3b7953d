"""Effective constraints: the bounds for the encoding (X.691) and the checks of a validator.

A type has its constraints in serial order. They answer two questions.

The encoding needs bounds (X.691 10.3, clause numbers of 02/2021). A constraint that PER ignores is called invisible:

- Only value ranges of INTEGER, SIZE, and FROM of the known-multiplier strings are visible (10.3.6 to 10.3.12);
- Invisible parts of an intersection are left out. A union with an invisible part is invisible. EXCEPT and the part
  after it are ignored (10.3.21);
- A FROM with an extension marker is invisible, and makes nothing extensible (30.4, NOTE 2);
- The last serial constraint decides whether a type is extensible. X.680 50.11 applies a constraint to its parent
  "without its extension marker", so an earlier marker is lost. According to X.691 10.3.20 this holds even if the last
  constraint is invisible. So WITH COMPONENT, WITH COMPONENTS or a table constraint such as ({Set}) removes the marker.
  The type `ConstraintWrappedCpmContainers` (CPM, TS 103 324) has no extension bit, though its parent SIZE(1..8, ...)
  has one. The parent's additions are lost, too. Only its root is narrowed;
- Some peers nevertheless keep the marker. `Bounds.lost_marker` marks types where that makes a difference; forms.py lays
  out the -ext form for them.

A validator needs the allowed values: unions with gaps, ALL EXCEPT, additions. With an extension marker it allows all
that the parent allows, because a value outside of the root belongs to a later edition.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from asn1.model.types import AllExcept, AllOf, Alphabet, AnyOf, Constraint, ElementSet, Range, Size, Values

Ranges = tuple[Range, ...]
"""Ascending, none touching another."""

EVERY: Ranges = (Range(None, None),)
SIZES: Ranges = (Range(0, None),)

# Table constraint (X.682 10). PER ignores it, but as the last constraint it removes an earlier extension marker.
TABLE = Constraint(root=AllOf(()))

# Characters of the known-multiplier string types that the ITS modules use (X.680 41, ISO 646).
ALPHABETS: dict[str, Ranges] = {
    "IA5String": (Range(0, 127),),
    "VisibleString": (Range(32, 126),),
    "ISO646String": (Range(32, 126),),
    "NumericString": (Range(32, 32), Range(48, 57)),
    "PrintableString": (
        Range(32, 32), Range(39, 41), Range(43, 58), Range(61, 61), Range(63, 63), Range(65, 90), Range(97, 122),
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of the extension root; None for MIN or MAX.

    gaps         ranges between low and high that are not allowed.
    lost_marker  an earlier serial constraint has an extension marker, but the last one has none.
    """

    low: int | None
    high: int | None
    is_extensible: bool = False
    gaps: Ranges = ()
    lost_marker: bool = False

    @property
    def width(self) -> int | None:
        """Number of bits of a constrained whole number (X.691 11.5.6); None if an end is open."""
        return None if self.low is None or self.high is None else (self.high - self.low).bit_length()


def value_bounds(constraints: tuple[Constraint, ...]) -> Bounds:
    """Return the bounds of an INTEGER. Raises ValueError if no value is left."""
    return _bounds(constraints, "value", EVERY)


def size_bounds(constraints: tuple[Constraint, ...]) -> Bounds:
    """Return the bounds of a string's or list's size, in bits, octets, characters or elements.

    Raises ValueError if no size is left.
    """
    return _bounds(constraints, "size", SIZES)


def alphabet(constraints: tuple[Constraint, ...], kind: str) -> Ranges | None:
    """Return the effective alphabet of a string type (X.691 10.3.12); None if no constraint narrows it."""
    whole = left = ALPHABETS.get(kind, EVERY)
    for constraint in constraints:
        seen = (
            None if constraint.is_extensible and _only_alphabet(constraint.root) else _set(constraint.root, "alphabet")
        )
        left = left if seen is None else intersection(left, seen)
    return None if left == whole else left


def has(values: Ranges, number: int) -> bool:
    return any((r.low is None or r.low <= number) and (r.high is None or number <= r.high) for r in values)


def count(values: Ranges) -> int:
    """Return the number of values. Raises ValueError for an open range."""
    total = 0
    for low, high in values:
        if low is None or high is None:
            raise ValueError(f"a set without end: {values}")
        total += high - low + 1
    return total


def _bounds(constraints: tuple[Constraint, ...], about: str, parent: Ranges) -> Bounds:
    seen, allowed, is_extensible, had_marker = parent, parent, False, False
    for constraint in constraints:
        root = _set(constraint.root, about)
        if root is not None:
            seen = intersection(seen, root)
        is_extensible = _is_extensible(constraint, about)
        had_marker = had_marker or is_extensible
        strict = parent if is_extensible else _set(constraint.root, about, strict=True)
        if strict is not None and not is_extensible:
            allowed = intersection(intersection(allowed, seen if root is not None else parent), strict)
    if not seen:
        raise ValueError("the constraints leave no value")
    low, high = seen[0].low, seen[-1].high
    gaps = () if is_extensible else _gaps(allowed, low, high)
    return Bounds(low, high, is_extensible, gaps, had_marker and not is_extensible)


def _gaps(allowed: Ranges, low: int | None, high: int | None) -> Ranges:
    return intersection(complement(allowed), (Range(low, high),))


def _set(element: ElementSet, about: str, strict: bool = False) -> Ranges | None:
    """Return the values, sizes or characters that a set allows; None if it does not restrict them, or PER ignores it.

    about   "value", "size" or "alphabet".
    strict  as a validator sees it, otherwise as PER does.
    """
    match element:
        case Values():
            return element.ranges if about == "value" else None
        case Size():
            return _numbers(element.within, strict) if about == "size" else None
        case Alphabet():
            if element.within.is_extensible and not strict:
                return None
            return _numbers(element.within, strict) if about == "alphabet" else None
        case AnyOf():
            parts = [_set(member, about, strict) for member in element.members]
            return None if any(part is None for part in parts) else union(r for part in parts for r in part or ())
        case AllOf():
            left: Ranges | None = None
            for member in element.members:
                part = _set(member, about, strict)
                left = part if left is None else left if part is None else intersection(left, part)
            return left
        case AllExcept():
            part = _set(element.member, about, strict) if strict else None
            return None if part is None else complement(part)
        case _:
            return None


def _numbers(constraint: Constraint, strict: bool) -> Ranges | None:
    return None if strict and constraint.is_extensible else _set(constraint.root, "value", strict)


def _is_extensible(constraint: Constraint, about: str) -> bool:
    if constraint.is_extensible:
        return about == "value" or not _only_alphabet(constraint.root)
    return _has_marker(constraint.root)


def _has_marker(element: ElementSet) -> bool:
    """Return whether a part of a set has an extension marker; then the set is extensible (X.680 50.4, 50.5)."""
    match element:
        case Size():
            return element.within.is_extensible
        case AnyOf() | AllOf():
            return any(_has_marker(member) for member in element.members)
        case _:
            return False


def _only_alphabet(element: ElementSet) -> bool:
    match element:
        case Alphabet():
            return True
        case AnyOf() | AllOf():
            return bool(element.members) and all(_only_alphabet(member) for member in element.members)
        case _:
            return False


# ---------------------------------------------------------------- sets of numbers


def union(ranges: Iterable[Range]) -> Ranges:
    """Return the ranges sorted and merged."""
    joined: list[Range] = []
    for low, high in sorted(ranges, key=lambda r: (r.low is not None, r.low or 0)):
        last = joined[-1] if joined else None
        if last is None or (last.high is not None and low is not None and low > last.high + 1):
            joined.append(Range(low, high))
        elif last.high is not None:
            joined[-1] = Range(last.low, None if high is None else max(high, last.high))
    return tuple(joined)


def intersection(left: Ranges, right: Ranges) -> Ranges:
    found = []
    for a in left:
        for b in right:
            low = b.low if a.low is None else a.low if b.low is None else max(a.low, b.low)
            high = b.high if a.high is None else a.high if b.high is None else min(a.high, b.high)
            if low is None or high is None or low <= high:
                found.append(Range(low, high))
    return union(found)


def complement(ranges: Ranges) -> Ranges:
    """Return all numbers outside the ranges."""
    found: list[Range] = []
    low: int | None = None
    for r in ranges:
        if r.low is not None:
            found.append(Range(low, r.low - 1))
        if r.high is None:
            return tuple(found)
        low = r.high + 1
    return (*found, Range(low, None))
