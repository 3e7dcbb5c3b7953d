"""Foreign input: names messages of SAE J2735 and XML without decoding them."""

import re
from collections.abc import Iterable
from itertools import chain, islice
from typing import NamedTuple

# DSRCmsgID of SAE J2735_202409, with the type's name and its abbreviation, if any. 18 to 32 are the same in
# J2735_201603. ISO/TS 19091 uses 18, 19 and 28 to 30 of them. Older editions have other numbers.
J2735 = {
    18: "MapData (MAP)",
    19: "SPAT",
    20: "BasicSafetyMessage (BSM)",
    21: "CommonSafetyRequest (CSR)",
    22: "EmergencyVehicleAlert (EVA)",
    23: "IntersectionCollision (ICA)",
    24: "NMEAcorrections",
    25: "ProbeDataManagement (PDM)",
    26: "ProbeVehicleData (PVD)",
    27: "RoadSideAlert (RSA)",
    28: "RTCMcorrections (RTCM)",
    29: "SignalRequestMessage (SRM)",
    30: "SignalStatusMessage (SSM)",
    31: "TravelerInformation (TIM)",
    32: "PersonalSafetyMessage (PSM)",
    33: "RoadSafetyMessage (RSM)",
    34: "RoadWeatherMessage (RWM)",
    35: "ProbeDataConfigMessage",
    36: "ProbeDataReportMessage",
    37: "TollAdvertisementMessage (TAM)",
    38: "TollUsageMessage (TUM)",
    39: "TollUsageAckMessage",
    40: "CooperativeControlMessage (CCM)",
    41: "SensorDataSharingMessage (SDSM)",
    42: "ManeuverSharingAndCoordinatingMessage (MSCM)",
    43: "RoadGeometryAndAttributes (RGA)",
    44: "PersonalSafetyMessage2",
    45: "TrafficSignalPhaseAndTiming",
    46: "SignalControlAndPrioritizationRequest",
    47: "SignalControlAndPrioritizationStatus",
    48: "RoadUserChargingConfigMessage",
    49: "RoadUserChargingReportMessage",
    50: "TrafficLightStatusMessage",
    **{240 + number: f"TestMessage{number:02}" for number in range(16)},
}

READ = "hexadecimal, base64, octets, JSON (JER), pcap, pcapng or MCAP"

_NO_ELEMENT = re.compile(r"\s+|<\?.*?\?>|<!--.*?-->|<![^>]*>", re.DOTALL)
_ELEMENT = re.compile(r"<([^\s<>/!?]{1,60})")
_WHOLE = re.compile(r"\s*<([^\s<>/!?]{1,60})[^<>]*(/>|>.*</\1\s*>)\s*", re.DOTALL)
_MOST_LINES = 1000  # limit for lines before the root element, such as a licence in a comment


def message_frame(octets: bytes) -> str | None:
    """Return a sentence for a MessageFrame of SAE J2735 in UPER that fills the octets; None for other octets."""
    found = _message_frame(octets)
    if found is None or found.size != len(octets):
        return None
    return f"it is a MessageFrame of SAE J2735: {found}; captain decodes messages of ETSI ITS only"


def damaged_message_frame(octets: bytes) -> str | None:
    """Return a sentence for a MessageFrame that is truncated, or followed by other octets; None for other octets."""
    found = _message_frame(octets)
    if found is None:
        return None
    if found.size > len(octets):
        return f"truncated SAE J2735 MessageFrame ({found}): {len(octets)} of {found.size} octets"
    more = len(octets) - found.size
    return f"{more} {'octet follows' if more == 1 else 'octets follow'} the SAE J2735 MessageFrame ({found})"


class _MessageFrame(NamedTuple):
    """Head of a MessageFrame. size: total octets by its length field."""

    message_id: int
    size: int

    def __str__(self) -> str:
        return f"messageId {self.message_id}, {J2735[self.message_id]}"


def _message_frame(octets: bytes) -> _MessageFrame | None:
    """Parse an extension bit (0), 15 bits of messageId, and an open type with its length (X.691 11.9.3, 11.2)."""
    if len(octets) < 4 or octets[0] or octets[1] not in J2735 or octets[2] >= 0xC0:
        return None
    length, begin = (octets[2], 3) if octets[2] < 0x80 else (int.from_bytes(octets[2:4]) & 0x3FFF, 4)
    return _MessageFrame(octets[1], begin + length)


class Xml(NamedTuple):
    """A text in XML.

    why       sentence that it cannot be read, with its root element.
    is_whole  its element ends in the first line; further lines are separate input.
    """

    why: str
    is_whole: bool


def xml(line: str, following: Iterable[str]) -> Xml | None:
    """Return a description of a text in XML, by its root element; None for a line that does not begin XML.

    line       the first line that is not blank.
    following  lines after it. At most 999 are read, and none if the element ends in the first line.

    Raises nothing: a text without an element counts as XML, too.
    Source: ITU-T X.693, XER; W3C XML 1.0, production 1.
    """
    if not line.lstrip().startswith("<"):
        return None
    is_whole = _WHOLE.fullmatch(line) is not None
    text = "".join([line] if is_whole else islice(chain([line], following), _MOST_LINES))
    at = 0
    while found := _NO_ELEMENT.match(text, at):
        at = found.end()
    root = _ELEMENT.match(text, at)
    named = f"root element {root[1]}" if root else "no root element"
    return Xml(f"XER or other XML is not read: {named}; give {READ}", is_whole)
