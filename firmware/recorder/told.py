"""A frame as topic `frame.` of a station tells it, and what a person is told of it."""

import json
from collections.abc import Mapping
from typing import NamedTuple

# Of the object these stand in the recording by themselves.
APART = frozenset({"interface", "direction", "when_ns"})
MOST = (1 << 63) - 1
_FLAT = (str, int, float, bool, type(None))


class Told(NamedTuple):
    """One frame. said: the object of the topic; when_ns is Unix time."""

    interface: str
    is_out: bool
    when_ns: int
    frame: bytes
    said: Mapping[str, object]

    @property
    def type(self) -> str:
        return str(self.said.get("type", ""))

    @property
    def is_dropped(self) -> bool:
        return bool(self.said.get("reason"))


def parse(frames: list[bytes]) -> Told | None:
    """A message of `frame.`; None for rubbish."""
    if len(frames) != 3:
        return None
    try:
        said = json.loads(frames[1])
    except (ValueError, RecursionError):
        return None
    if not isinstance(said, dict) or not _is_sound(said):
        return None
    return Told(said["interface"], said["direction"] == "out", said["when_ns"], frames[2], said)


def _is_sound(said: dict[str, object]) -> bool:
    """Whether it is as a station says it: numbers that a file has room for, and nothing deep."""
    are_counts = all(
        type(count := said.get(key, 0)) is int and 0 <= count <= MOST
        for key in ("when_ns", "sequence", "missed", "total")
    )
    are_flat = all(isinstance(value, _FLAT) or key == "quality" for key, value in said.items())
    has_all = isinstance(said.get("interface"), str) and "direction" in said and "when_ns" in said
    return are_counts and are_flat and has_all


def kept_of(said: Mapping[str, object]) -> dict[str, object]:
    """What of the object goes into a recording."""
    return {key: value for key, value in said.items() if key not in APART and value is not None}


def comment_of(told: Told) -> str:
    """In words: what it is, what became of it, how it was heard, how good its time is."""
    said = told.said
    parts = []
    if told.type:
        parts.append(f"{told.type} of station {said.get('station_id')}")
    if told.is_dropped:
        detail = f": {said['detail']}" if said.get("detail") else ""
        what = "not sent" if told.is_out else "dropped"
        parts.append(f"{what}: {said['reason']}: {said.get('meaning', '')}{detail}")
    if said.get("rssi_dbm") is not None:
        parts.append(f"{said['rssi_dbm']} dBm")
    if said.get("implausible"):
        parts.append(f"implausible: {said['implausible']}")
    if isinstance(said.get("queue_us"), int | float) and not told.is_dropped:
        parts.append(f"queued for {said['queue_us']} us, sent in {said.get('send_us')} us")
    if said.get("is_made_up"):
        parts.append("headers made up")
    parts.append(_clock(said.get("quality")))
    return "; ".join(filter(None, parts))


def _clock(quality: object) -> str:
    if not isinstance(quality, dict):
        return ""
    error_ns = quality.get("error_ns")
    exact = f" +-{error_ns / 1000:g} us" if isinstance(error_ns, int) else ", how exact is not known"
    return f"time {quality.get('state', 'unknown')}{exact}"
