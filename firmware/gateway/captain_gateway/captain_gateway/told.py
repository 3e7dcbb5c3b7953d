"""JSON reports of a station: parses them; invalid ones cannot stop the node."""

import json
from typing import Any


def table(octets: bytes) -> dict[str, Any] | None:
    """Parse a JSON object whose strings are valid in ROS; None for anything else."""
    try:
        # json.loads() of octets guesses the encoding, and accepts unpaired surrogates.
        words = octets.decode()
        told = json.loads(words)
        if "\\ud" in words.lower():  # encoding fails for an unpaired surrogate
            json.dumps(told, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        return None
    return told if isinstance(told, dict) else None


def number(told: dict[str, Any], name: str, low: float, high: float) -> float | None:
    """Return the number in a member of an object; None if it is missing, not a number, or out of range."""
    # Compare before the conversion: a JSON integer of four hundred digits does not fit a float.
    value = told.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        return None
    return float(value)
