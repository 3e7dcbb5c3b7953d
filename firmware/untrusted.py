"""Untrusted JSON objects and tables: absent or mistyped values become neutral ones."""

from collections.abc import Mapping


def text(table: Mapping[str, object], key: str) -> str:
    found = table.get(key)
    return found if isinstance(found, str) else ""


def number(table: Mapping[str, object], key: str) -> float:
    """Return the number of a key; 0.0 if it is absent, of another type, NaN, or beyond 64-bit counters (2**63)."""
    found = table.get(key)
    if isinstance(found, bool) or not isinstance(found, int | float) or not -(2.0**63) <= found <= 2.0**63:
        return 0.0
    return float(found)


def within(table: Mapping[str, object], key: str) -> dict[str, object]:
    found = table.get(key)
    return found if isinstance(found, dict) else {}


def listed(table: Mapping[str, object], key: str) -> list[dict[str, object]]:
    """Return the objects in the list of a key."""
    found = table.get(key)
    return [item for item in found if isinstance(item, dict)] if isinstance(found, list) else []


def texts(table: Mapping[str, object], key: str) -> list[str]:
    """Return the strings in the list of a key."""
    found = table.get(key)
    return [item for item in found if isinstance(item, str)] if isinstance(found, list) else []


def named(table: Mapping[str, object], key: str) -> list[tuple[str, dict[str, object]]]:
    """Return the names and values of those members of a key's object that are objects."""
    return [(name, one) for name, one in within(table, key).items() if isinstance(one, dict)]


def total(table: Mapping[str, object], key: str) -> float:
    """Return the sum of the numbers in the object of a key."""
    counts = within(table, key)
    return sum(number(counts, name) for name in counts)
