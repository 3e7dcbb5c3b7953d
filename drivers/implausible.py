"""Implausible frames: the reasons, and their meaning in words.

A frame with a reason is passed on with it: nothing that is sent without a signature can be trusted, and a test or a
clock that is wrong looks the same as an attack. The policy says what is dropped.
"""

from enum import StrEnum


class Implausible(StrEnum):
    """A reason as indications, status and the policy have it; MEANING says it in words."""

    POSITION = "position"
    TIME = "time"
    SOURCE = "source"
    SEQUENCE = "sequence"
    OWN_ADDRESS = "own-address"


MEANING: dict[Implausible, str] = {
    Implausible.POSITION: "a latitude beyond 90 or a longitude beyond 180 degrees, of the sender or its area",
    Implausible.TIME: "timestamp more than 60 s ahead or more than 6360 s old, or a DENM time more than 60 s ahead",
    Implausible.SOURCE: "source MAC addresses of frame and GeoNetworking packet differ, and it was not forwarded",
    Implausible.SEQUENCE: "two different packets of one source have one sequence number",
    Implausible.OWN_ADDRESS: "another station uses the address of this one",
}

AHEAD_MS = 60_000  # tolerance for times: a clock that is wrong by the leap seconds (18 or 37 s) is not an attack
# In 1e-7 degree. One step beyond the end of the world stands for an unknown place (TS 102 894-2 V2.4.1, Latitude and
# Longitude).
MOST_LATITUDE, MOST_LONGITUDE = 900_000_001, 1_800_000_001


def is_outside(latitude: int, longitude: int) -> bool:
    """Return whether a place, in 1e-7 degree, is beyond the ends of the world."""
    return not (-MOST_LATITUDE < latitude <= MOST_LATITUDE and -MOST_LONGITUDE < longitude <= MOST_LONGITUDE)
