"""Reasons of omitted messages, counted in bounded memory: a malformed capture may produce one per frame."""

from collections import Counter

MOST = 50
OTHERS = "other reasons"


def count(tally: Counter[str], why: str) -> str:
    """Count a reason, or OTHERS beyond MOST reasons; return the counted name."""
    key = why if why in tally or len(tally) < MOST else OTHERS
    tally[key] += 1
    return key
