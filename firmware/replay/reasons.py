"""Why something was left out, counted in bounded memory: a broken capture has as many reasons as frames."""

from collections import Counter

MOST = 50
OTHERS = "other reasons"


def count(tally: Counter[str], why: str) -> str:
    """Count a reason, by its words or as one of the others. Returns what it was counted as."""
    key = why if why in tally or len(tally) < MOST else OTHERS
    tally[key] += 1
    return key
