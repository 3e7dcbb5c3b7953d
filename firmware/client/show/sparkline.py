"""Sparkline: a row of marks whose heights follow values."""

import math
import os
from collections.abc import Sequence
from typing import TextIO

from firmware.clock.time_history import mean

BLOCKS = "▁▂▃▄▅▆▇█"
LETTERS = "_.-=+*%#"  # in increasing darkness; every terminal can show them
BLANK = " "
# Terminals that show only ASCII, even if the locale says UTF-8.
PLAIN = frozenset({"", "dumb", "vt52", "vt100", "vt102", "vt220"})


def marks_for(stream: TextIO) -> str:
    """Return the marks that a stream can show, from low to high."""
    is_wide = (stream.encoding or "").lower().replace("-", "") == "utf8"
    is_able = not stream.isatty() or os.environ.get("TERM", "") not in PLAIN
    return BLOCKS if is_wide and is_able else LETTERS


def sparkline(values: Sequence[float], width: int, marks: str = LETTERS) -> str:
    """Return a line of at most `width` marks, one for each equal part of the values.

    Each mark shows the mean of its part, scaled between the smallest and the largest mean. NaN means unknown; a part
    with an unknown mean is blank. Fewer values than `width` give one mark each.
    """
    means = [mean(part) for part in _parts(values, width)]
    known = [one for one in means if not math.isnan(one)]
    if not known:
        return ""
    least, step = min(known), (max(known) - min(known)) / len(marks)
    return "".join(BLANK if math.isnan(one) else marks[_level(one - least, step, len(marks))] for one in means)


def _level(above: float, step: float, count: int) -> int:
    return min(count - 1, int(above / step)) if step > 0 else count // 2


def _parts(values: Sequence[float], width: int) -> list[Sequence[float]]:
    count = min(width, len(values))
    return [values[at * len(values) // count : (at + 1) * len(values) // count] for at in range(count)]
