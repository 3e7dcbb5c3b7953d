"""Events of one message: sent by an interface, received by one, or not sent."""

from typing import NamedTuple

from firmware.endpoint.report import digest_of

# "PROB" in ASCII: stationID of the meter's own messages. A station has it by chance with a probability of 2**-32.
PROBES = 0x50524F42


class Clock(NamedTuple):
    """Clock of a time stamp, and its accuracy at that time.

    boot            boot id of the machine: stamps with the same boot id are of one clock. Empty if unknown.
    offset_ns       true time minus stamp; None if unknown.
    uncertainty_ns  uncertainty of offset_ns; None if unknown.
    """

    boot: str = ""
    offset_ns: int | None = None
    uncertainty_ns: int | None = None


NO_CLOCK = Clock()


class What(NamedTuple):
    """Identification of a PDU without its octets.

    digest      digest of the octets.
    type        type name in the envelope.
    station_id  stationID; None if the PDU is too short.
    octets      length.
    """

    digest: str
    type: str
    station_id: int | None
    octets: int


class Sent(NamedTuple):
    """A PDU that left a station by an interface.

    accepted_ns  Unix time by the station's clock at which the station accepted it from its user.
    queue_ns     time from then until its driver had it.
    send_ns      time from then until it had left.
    clock        clock of these stamps.
    at_s         approximate time of the report on the meter's time line, which all stations share.
    is_probe     the meter itself has sent it.
    """

    station: str
    interface: str
    what: What
    accepted_ns: int
    queue_ns: int
    send_ns: int
    clock: Clock
    at_s: float
    is_probe: bool = False

    @property
    def handed_ns(self) -> int:
        return self.accepted_ns + self.queue_ns


class ReceivedEvent(NamedTuple):
    """A PDU that arrived at a station by an interface.

    received_ns is Unix time by the station's clock, at_s is as in Sent.
    """

    station: str
    interface: str
    what: What
    received_ns: int
    clock: Clock
    at_s: float
    rssi_dbm: int | None = None


def what_of(pdu: bytes, kind: str) -> What:
    station_id = int.from_bytes(pdu[2:6]) if len(pdu) >= 6 else None
    return What(digest_of(pdu), kind, station_id, len(pdu))
