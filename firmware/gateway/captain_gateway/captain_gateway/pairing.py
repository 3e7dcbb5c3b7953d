"""Pairing of the three ZeroMQ messages per received message: raw, PDU and indication."""

import hashlib
from collections import OrderedDict
from types import ModuleType
from typing import Any, NamedTuple

from .errors import GatewayError
from .told import table

# Longest wait for an indication. With "soon." it follows its message within a millisecond; on an overloaded machine
# it arrives later, together with other queued messages.
LATEST_S = 0.05
# Most waiting indications. Those of duplicates wait in vain, because the station suppresses the message.
MOST = 1024
MOST_PORT = 0xFFFF


class Reception(NamedTuple):
    """RawRxMessage without its payload. Times are Unix time in ns, places in 1e-7 degree; 0 and None mean unknown."""

    received_ns: int
    own_ns: int
    own: tuple[int, int] | None
    sender: tuple[int, int] | None
    rssi_dbm: int
    data_rate: int
    traffic_class: int
    hop_limit: int
    security_status: int
    its_aid: int
    source_mac: bytes


class How(NamedTuple):
    """Facts that only the indication has."""

    interface: str
    btp_port: int
    source: str


class Arrival(NamedTuple):
    """A received message. type: the part of its envelope between `v2x.` and the last dot."""

    type: str
    pdu: bytes
    reception: Reception | None


STATUS = {"none": 0, "invalid-fmt": 1, "verified-pkt": 2, "unverifiable-pkt": 3}


class RawReader:
    """Decoder of RawRxMessage. Raises GatewayError if the message library lacks it."""

    PATHS = (
        "localInfo.timestamp.sec", "localInfo.timestamp.usec",
        "localInfo.positionInfo.latitude", "localInfo.positionInfo.longitude",
        "rxInfo.timestamp.sec", "rxInfo.timestamp.usec",
        "rxInfo.rssi", "rxInfo.dataRate", "rxInfo.trafficClassID", "rxInfo.remainHopLimit",
        "rxInfo.security.status", "rxInfo.security.itsAID",
        "rxInfo.positionInfo.latitude", "rxInfo.positionInfo.longitude",
        "rxInfo.sourceMacAddress", "payloadString",
    )  # fmt: skip

    def __init__(self, library: ModuleType) -> None:
        try:
            self._read = library.find("rawrx-1").reader(*self.PATHS)
        except LookupError as error:
            raise GatewayError(
                f"{library.__file__} lacks the message rawrx-1, a station's report of a reception: add rawrx-1 or --all"
            ) from error

    def __call__(self, octets: bytes) -> tuple[Reception, bytes]:
        """Return the known facts and the payload. Raises ValueError if it does not decode."""
        (own_s, own_us, own_latitude, own_longitude, second, us, rssi, data_rate, traffic_class, hop_limit,
         security, its_aid, latitude, longitude, mac, pdu) = self._read(octets)  # fmt: skip
        has_own = own_s is not None
        found = Reception(
            _ns(second, us),
            _ns(own_s, own_us) if has_own else 0,
            (own_latitude, own_longitude) if has_own else None,
            (latitude, longitude) if latitude or longitude else None,
            rssi, data_rate, traffic_class, hop_limit, STATUS.get(security, 0), its_aid, mac,
        )  # fmt: skip
        return found, pdu or b""


def _ns(seconds: int, microseconds: int) -> int:
    return seconds * 1_000_000_000 + microseconds * 1000


class Joining:
    """Joins the messages `raw.` and `v2x.<type>.` of port 5556, which follow each other.

    rubbish  number of unreadable messages, including those of port 5558.
    sample   first octets of the last one.
    """

    def __init__(self, read: RawReader) -> None:
        self.rubbish = 0
        self.sample = b""
        self._read = read
        self._raw: tuple[Reception, bytes] | None = None

    def feed(self, frames: list[bytes]) -> Arrival | None:
        """Take one ZeroMQ message. Returns an Arrival for `v2x.<type>.`, None for the rest. It never raises."""
        if len(frames) != 2:
            self.reject(b"".join(frames))
            return None
        envelope, octets = frames
        if envelope == b"raw.":
            self._raw = None
            try:
                self._raw = self._read(octets)
            except (ValueError, MemoryError):
                self.reject(octets)
        elif envelope.startswith(b"v2x.") and envelope.endswith(b".") and len(envelope) > 4:
            kept, self._raw = self._raw, None
            reception = kept[0] if kept is not None and kept[1] == octets else None
            return Arrival(envelope[4:-1].decode("ascii", "backslashreplace"), octets, reception)
        elif envelope != b"hb.counter":
            self.reject(envelope)
        return None

    def reject(self, sample: bytes) -> None:
        """Count an unreadable message."""
        self.rubbish += 1
        self.sample = sample[:32]


Key = tuple[bytes, int]  # first 8 octets of the PDU's SHA-256, and time of reception in microseconds


def key(pdu: bytes, received_ns: int) -> Key:
    """Return the key that an indication and its message share. Time is in microseconds, as in RawRxMessage."""
    return hashlib.sha256(pdu).digest()[:8], received_ns // 1000


def indication(octets: bytes) -> tuple[Key, How] | None:
    """Parse an indication of the report port; None if it is malformed."""
    told = table(octets)
    if told is None:
        return None
    try:
        how = How(str(told["interface"]), int(told["btp_port"] or 0), str(told["source"] or ""))
        found = (bytes.fromhex(told["digest"]), int(told["received_ns"]) // 1000), how
    except (ValueError, KeyError, TypeError, OverflowError):
        return None
    return found if 0 <= how.btp_port <= MOST_PORT else None


class Waiting:
    """Messages that wait for their indication, and indications that wait for their message."""

    def __init__(self) -> None:
        self._messages: OrderedDict[Key, tuple[float, Any]] = OrderedDict()
        self._indications: OrderedDict[Key, How] = OrderedDict()

    def message(self, key: Key, what: Any, now: float) -> How | None:
        """Return the indication of a message, if it has arrived; else None, and `what` waits for it."""
        how = self._indications.pop(key, None)
        if how is None:
            self._messages[key] = (now, what)
        return how

    def indication(self, key: Key, how: How) -> Any | None:
        """Return the object that waited for this indication; else None, and the indication waits for its message."""
        found = self._messages.pop(key, None)
        if found is not None:
            return found[1]
        self._indications[key] = how
        if len(self._indications) > MOST:
            self._indications.popitem(last=False)
        return None

    def expired(self, now: float) -> list[Any]:
        """Remove and return the objects that have waited longer than LATEST_S, or exceed MOST."""
        gone = []
        while self._messages:
            key, (since, what) = next(iter(self._messages.items()))
            if now - since < LATEST_S and len(self._messages) <= MOST:
                break
            del self._messages[key]
            gone.append(what)
        return gone

    @property
    def is_empty(self) -> bool:
        return not self._messages
