"""A row of numbers as one line of text: for a serial console, over which no picture comes."""

import math
import os
from collections.abc import Sequence
from typing import TextIO

BLOCKS = "▁▂▃▄▅▆▇█"
LETTERS = "_.-=+*%#"  # of about as much ink; every terminal has them
GAP = " "
# Terminals that have letters and nothing else, whatever the locale says.
PLAIN = frozenset({"", "dumb", "vt52", "vt100", "vt102", "vt220"})


def marks_for(stream: TextIO) -> str:
    """The marks that a stream can show, from low to high."""
    is_wide = (stream.encoding or "").lower().replace("-", "") == "utf8"
    is_able = not stream.isatty() or os.environ.get("TERM", "") not in PLAIN
    return BLOCKS if is_wide and is_able else LETTERS


def sparkline(values: Sequence[float], width: int, marks: str = LETTERS) -> str:
    """One mark for each of width equal parts of the values: their mean, between the least mean and the largest.

    NaN is what is not known; a part of nothing else is a gap. Fewer values than width make as many marks.
    """
    means = [_mean(part) for part in _parts(values, width)]
    known = [mean for mean in means if not math.isnan(mean)]
    if not known:
        return ""
    least, step = min(known), (max(known) - min(known)) / len(marks)
    return "".join(GAP if math.isnan(mean) else marks[_level(mean - least, step, len(marks))] for mean in means)


def _level(above: float, step: float, count: int) -> int:
    return min(count - 1, int(above / step)) if step > 0 else count // 2


def _parts(values: Sequence[float], width: int) -> list[Sequence[float]]:
    count = min(width, len(values))
    return [values[at * len(values) // count : (at + 1) * len(values) // count] for at in range(count)]


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan
