"""Times of a DENM at their fixed place: the same in every edition of the message library."""

import json
from typing import Any

import pytest

from firmware.codec.library import load
from firmware.routing.implausible import AHEAD_MS, is_denm_ahead

NOW_MS = 722_130_000_000
ELLIPSE = ("semiMajorConfidence", "semiMinorConfidence", "semiMajorOrientation")


def denm(edition: str, detection_ms: int, reference_ms: int, **more: object) -> bytes:
    is_old = edition == "denm-1.3.1"
    of = "ID" if is_old else "Id"
    management: dict[str, Any] = {
        f"action{of}": {f"originatingStation{of}": 7, "sequenceNumber": 1},
        "detectionTime": detection_ms,
        "referenceTime": reference_ms,
        "eventPosition": {
            "latitude": 487_668_616,
            "longitude": 114_320_680,
            "positionConfidenceEllipse": dict.fromkeys(ELLIPSE, 100),
            "altitude": {"altitudeValue": 0, "altitudeConfidence": "unavailable"},
        },
        "stationType": 5,
        **more,
    }
    header = {"protocolVersion": 1 if is_old else 2, f"message{of}": 1, f"station{of}": 7}
    message = load().find(edition)
    return bytes(message.from_json(json.dumps({"header": header, "denm": {"management": management}})))


@pytest.mark.parametrize("edition", ["denm-1.3.1", "denm-2.2.1", "denm-2.3.1"])
@pytest.mark.parametrize("more", [{}, {"termination": "isCancellation", "validityDuration": 5}])
@pytest.mark.parametrize(
    ("detection_ms", "reference_ms", "is_ahead"),
    [
        (NOW_MS, NOW_MS, False),
        (NOW_MS + AHEAD_MS, NOW_MS + AHEAD_MS, False),
        (NOW_MS + AHEAD_MS + 1, NOW_MS, True),
        (NOW_MS, NOW_MS + AHEAD_MS + 1, True),
        (0, 2**42 - 1, True),
        (0, 0, False),
    ],
)
def test_the_times_of_a_denm_are_read_in_each_edition(
    edition: str, more: dict[str, object], detection_ms: int, reference_ms: int, is_ahead: bool
) -> None:
    assert is_denm_ahead(denm(edition, detection_ms, reference_ms, **more), NOW_MS) is is_ahead
