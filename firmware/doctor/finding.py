"""Finding of a check: level, subject, text and remedy."""

from enum import Enum
from typing import NamedTuple


class Level(Enum):
    """Level of a finding."""

    OK = "ok"
    WARNING = "warning"  # the station runs, but with limits, or not beside a running one
    PROBLEM = "problem"  # the station does not run


class Finding(NamedTuple):
    """One line of the doctor's report. remedy: what to do; empty if nothing is needed."""

    level: Level
    subject: str
    text: str
    remedy: str = ""
