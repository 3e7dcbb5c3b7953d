"""JSON that a station says, read so that nothing in it ends the node: a table, and numbers in it."""

import json
from typing import Any


def table(octets: bytes) -> dict[str, Any] | None:
    """A JSON object of which every text can be said in ROS; None for rubbish."""
    try:
        # json.loads() of octets guesses the encoding, and lets halves of surrogate pairs through.
        words = octets.decode()
        told = json.loads(words)
        if "\\ud" in words.lower():  # half of a surrogate pair is no text
            json.dumps(told, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        return None
    return told if isinstance(told, dict) else None


def number(told: dict[str, Any], name: str, low: float, high: float) -> float | None:
    """Of a table; None where it is no number between these."""
    # Compared before it is made a float: a whole number of JSON may have four hundred digits.
    value = told.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        return None
    return float(value)
