"""Frame reported on topic `frame.`: parses it and writes its comment for a recording."""

import json
from collections.abc import Mapping
from typing import NamedTuple

# Keys that a recording stores in fields of its own, not in the custom option.
APART = frozenset({"interface", "direction", "when_ns"})
MOST = (1 << 63) - 1
_FLAT = (str, int, float, bool, type(None))


class ReportedFrame(NamedTuple):
    """Reported frame.

    interface  name of its interface.
    is_out     the frame was sent, not received.
    when_ns    Unix time in nanoseconds.
    frame      octets of the frame.
    said       JSON object of the topic.
    """

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


def parse(frames: list[bytes]) -> ReportedFrame | None:
    """Parse a message of topic `frame.`; return None if it is invalid."""
    if len(frames) != 3:
        return None
    try:
        said = json.loads(frames[1])
    except (ValueError, RecursionError):
        return None
    if not isinstance(said, dict) or not _is_sound(said):
        return None
    return ReportedFrame(said["interface"], said["direction"] == "out", said["when_ns"], frames[2], said)


def _is_sound(said: dict[str, object]) -> bool:
    """Whether the object is valid: flat, with all required keys and numbers within range."""
    are_counts = all(
        type(count := said.get(key, 0)) is int and 0 <= count <= MOST
        for key in ("when_ns", "sequence", "missed", "total")
    )
    are_flat = all(isinstance(value, _FLAT) or key == "quality" for key, value in said.items())
    has_all = isinstance(said.get("interface"), str) and "direction" in said and "when_ns" in said
    return are_counts and are_flat and has_all


def kept_of(said: Mapping[str, object]) -> dict[str, object]:
    """Return the part of the object that a recording stores in the frame's custom option."""
    return {key: value for key, value in said.items() if key not in APART and value is not None}


def comment_of(told: ReportedFrame) -> str:
    """Return the comment of a frame: message type, drop reason, signal strength, delays, accuracy of the time."""
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
    exact = f" +-{error_ns / 1000:g} us" if isinstance(error_ns, int) else ", accuracy unknown"
    return f"time {quality.get('state', 'unknown')}{exact}"
