"""A JSON object of a peer, read without trust: what is absent or of another type has its neutral value."""

from collections.abc import Mapping


def text(table: Mapping[str, object], key: str) -> str:
    found = table.get(key)
    return found if isinstance(found, str) else ""


def number(table: Mapping[str, object], key: str) -> float:
    """An int or float that is neither NaN nor beyond 2**63, where peers' counters end."""
    found = table.get(key)
    if isinstance(found, bool) or not isinstance(found, int | float) or not -(2.0**63) <= found <= 2.0**63:
        return 0.0
    return float(found)


def within(table: Mapping[str, object], key: str) -> dict[str, object]:
    found = table.get(key)
    return found if isinstance(found, dict) else {}


def listed(table: Mapping[str, object], key: str) -> list[dict[str, object]]:
    """The objects of a list."""
    found = table.get(key)
    return [item for item in found if isinstance(item, dict)] if isinstance(found, list) else []


def texts(table: Mapping[str, object], key: str) -> list[str]:
    """The strings of a list."""
    found = table.get(key)
    return [item for item in found if isinstance(item, str)] if isinstance(found, list) else []


def named(table: Mapping[str, object], key: str) -> list[tuple[str, dict[str, object]]]:
    """The objects of an object of objects, with their names."""
    return [(name, one) for name, one in within(table, key).items() if isinstance(one, dict)]
