"""Implausible frames: the reasons, and their meaning in words.

An implausible frame is passed on together with its reasons. Without signatures no frame can be trusted, and a test or a
wrong clock looks like an attack. The policy decides which implausible frames are dropped.
"""

from enum import StrEnum


class Implausible(StrEnum):
    """Reason codes in indications, status and the policy. MEANING has their meanings; notes are below.

    time         concerns the packet's timestamp, or `detectionTime` and `referenceTime` of a DENM.
    source       compares the frame's source MAC address with that in the packet's GN_ADDR. A packet was not forwarded
                 if it is a single-hop broadcast, or if its remaining hop limit is its maximum hop limit.
    sequence     two packets within 20 s have different payloads: one is forged, or the source has restarted.
    own-address  the packet has this station's address, but is not among those that the station remembers to have sent:
                 at least the last 1024.
    """

    POSITION = "position"
    TIME = "time"
    SOURCE = "source"
    SEQUENCE = "sequence"
    OWN_ADDRESS = "own-address"


MEANING: dict[Implausible, str] = {
    Implausible.POSITION: "a latitude beyond 90 or a longitude beyond 180 degrees, of the sender or its area",
    Implausible.TIME: "timestamp more than 60 s ahead or more than 6360 s old, or a DENM time more than 60 s ahead",
    Implausible.SOURCE: "source MAC addresses of frame and GeoNetworking packet differ, and it was not forwarded",
    Implausible.SEQUENCE: "two different packets of the same source have the same sequence number",
    Implausible.OWN_ADDRESS: "another station uses the address of this one",
}

AHEAD_MS = 60_000  # tolerance for times in the future: a clock off by the leap seconds (18 or 37 s) is not an attack
# In 1e-7 degree. 90 or 180 degrees plus one step means an unknown position (TS 102 894-2 V2.4.1, Latitude and
# Longitude), so it is not implausible.
MOST_LATITUDE, MOST_LONGITUDE = 900_000_001, 1_800_000_001


def is_outside(latitude: int, longitude: int) -> bool:
    """Return True if a position in 1e-7 degree is out of range; the value for "unknown" is in range."""
    return not (-MOST_LATITUDE < latitude <= MOST_LATITUDE and -MOST_LONGITUDE < longitude <= MOST_LONGITUDE)
