"""What stations say of one message: that it left by an interface, that it came by one, or that nobody heard what."""

from typing import NamedTuple

from firmware.report import digest_of

# "PROB" in ASCII, the stationID of the meter's own messages: no station has it but by chance of one in four milliards.
PROBES = 0x50524F42


class Clock(NamedTuple):
    """Whose clock a stamp is of, and how good it was then.

    boot            of the machine: stamps of one boot are of one clock. Empty where nobody says it.
    offset_ns       true time less the stamp, +- uncertainty_ns; None where that is not known.
    """

    boot: str = ""
    offset_ns: int | None = None
    uncertainty_ns: int | None = None


NO_CLOCK = Clock()


class What(NamedTuple):
    """A PDU, without its octets."""

    digest: str
    type: str
    station_id: int | None
    octets: int


class Sent(NamedTuple):
    """A PDU that left a station by an interface.

    accepted_ns  Unix time by the station's clock, when it took it from its user; queue_ns later its driver had it,
                 send_ns after that it had left.
    at_s         the same moment on the one time line of all stations that is metered: no exact one.
    is_probe     it is one of this meter's own.
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


class Received(NamedTuple):
    """A PDU that came to a station by an interface; at_s as of Sent."""

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
