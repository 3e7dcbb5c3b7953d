"""Reports of port 5558: JSON objects by topic, and recorded frames."""

import json
from typing import Any, NamedTuple


class Frame(NamedTuple):
    """Frame that came or left by an interface.

    report  object of topic `frame.`: interface, direction, time, drop reason.
    octets  the Ethernet frame.
    """

    report: dict[str, Any]
    octets: bytes


def object_of(frames: list[bytes]) -> dict[str, Any] | None:
    """Return the JSON object of a report: topic and object, maybe with more frames. Return None if malformed."""
    try:
        found = json.loads(frames[1])
    except (IndexError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def frame_of(frames: list[bytes]) -> Frame | None:
    """Return the frame of a report of topic `frame.`; None if it is malformed."""
    report = object_of(frames)
    return None if report is None or len(frames) < 3 else Frame(report, frames[2])
