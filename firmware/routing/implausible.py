"""Plausibility checks that apply to every interface, and their counters."""

import logging

from drivers.implausible import AHEAD_MS, MEANING, Implausible, is_outside
from drivers.message import NO_MAC, RxInfo
from firmware.routing.drops import Drop

# Position of the times of a DENM: detectionTime and referenceTime, TimestampIts of 42 bits each, begin at bit 105 of
# the PDU. Header, presence bits and actionID before them have the same length in all editions (EN 302 637-3 V1.3.1,
# TS 103 831 V2.2.1, V2.3.1).
DENM = 1
_DENM_VERSIONS = frozenset({1, 2})
_FIRST, _END, _BEHIND = 13, 24, 3  # first octet and end of the octets with both times; number of bits after the times
_TIME_BITS = 42
_TIME = (1 << _TIME_BITS) - 1

log = logging.getLogger("captain.implausible")


def is_denm_ahead(pdu: bytes, its_ms: int) -> bool:
    """Return True if detectionTime or referenceTime of a DENM is in the future by more than AHEAD_MS.

    its_ms  own ITS time in ms; 0 if unknown, which gives False.
    """
    if not its_ms or len(pdu) < _END or pdu[0] not in _DENM_VERSIONS:
        return False
    times = int.from_bytes(pdu[_FIRST:_END]) >> _BEHIND
    return max(times >> _TIME_BITS & _TIME, times & _TIME) > its_ms + AHEAD_MS


def doubted(rx: RxInfo, is_ahead: bool) -> RxInfo:
    """Return rx with the reasons for implausibility added.

    `position` is added if the sender's position is out of range, `time` if is_ahead: a time in the future.
    """
    reasons = rx.implausible
    if Implausible.POSITION not in reasons and is_outside(*rx.position):
        reasons = (Implausible.POSITION, *reasons)
    if is_ahead and Implausible.TIME not in reasons:
        reasons = (*reasons, Implausible.TIME)
    return rx if reasons is rx.implausible else rx._replace(implausible=reasons)


class ImplausibleCounts:
    """Counters of implausible messages of one interface, by reason, each with the last message."""

    def __init__(self, interface: str) -> None:
        self._interface = interface
        self._counts: dict[Implausible, Drop] = {}

    def count(self, rx: RxInfo, pdu: bytes) -> None:
        """Count a message under each reason in rx.implausible, and log it at powers of ten."""
        for reason in rx.implausible:
            row = self._counts.get(reason)
            if row is None:
                row = self._counts[reason] = Drop()
            if row.add(pdu, 1, rx.source_mac.hex(":")):
                last = f"; the last from {row.detail}" if rx.source_mac != NO_MAC else ""
                what = f"{reason}: {MEANING[reason]}{last}"
                log.warning("%s: %d implausible messages: %s", self._interface, row.count, what)

    def status(self) -> list[dict[str, object]]:
        """Return a row for each reason.

        reason   reason why a message is implausible.
        meaning  meaning of the reason.
        source   source MAC address of the last message.
        """
        return [
            {
                "reason": str(reason),
                "meaning": MEANING[reason],
                **row.status(),
                "source": row.detail,
            }
            for reason, row in self._counts.items()
        ]
