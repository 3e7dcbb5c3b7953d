"""What a station says of one received message, in three parts on two sockets, put together again."""

import hashlib
from collections import OrderedDict
from types import ModuleType
from typing import Any, NamedTuple

from .errors import GatewayError
from .told import table

# Asked for soon, an indication comes within a millisecond of its message; on a machine that is late, with what else has
# piled up.
LATEST_S = 0.05
# Indications of messages that never come: of duplicates that the station has suppressed.
MOST = 1024
MOST_PORT = 0xFFFF


class Reception(NamedTuple):
    """RawRxMessage without its payload. Times are Unix time in ns; places 1e-7 degree; 0 and None are not known."""

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
    """What an indication adds."""

    interface: str
    btp_port: int
    source: str


class Arrival(NamedTuple):
    """A received message. type: as in its envelope."""

    type: str
    pdu: bytes
    reception: Reception | None


STATUS = {"none": 0, "invalid-fmt": 1, "verified-pkt": 2, "unverifiable-pkt": 3}


class RawReader:
    """Reads RawRxMessage by the message library. Raises GatewayError where that has no such message."""

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
                f"{library.__file__} has no rawrx-1, what a station says of a reception: generate it with that or --all"
            ) from error

    def __call__(self, octets: bytes) -> tuple[Reception, bytes]:
        """What is known, and the payload. Raises ValueError."""
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
    """Joins `raw.` and `v2x.<type>.` of 5556, which follow each other; rubbish is counted, that of 5558 as well."""

    def __init__(self, read: RawReader) -> None:
        self.rubbish = 0
        self.sample = b""
        self._read = read
        self._raw: tuple[Reception, bytes] | None = None

    def feed(self, frames: list[bytes]) -> Arrival | None:
        """Take one ZeroMQ message. Returns an Arrival for `v2x.<type>.`, None for the rest; never raises."""
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
        """Count what is no message of a station."""
        self.rubbish += 1
        self.sample = sample[:32]


Key = tuple[bytes, int]  # the first 8 octets of a SHA-256, and received_ns in microseconds


def key(pdu: bytes, received_ns: int) -> Key:
    """By what an indication and its message know each other: RawRxMessage has microseconds."""
    return hashlib.sha256(pdu).digest()[:8], received_ns // 1000


def indication(octets: bytes) -> tuple[Key, How] | None:
    """Of an indication as the station's report port has it; None for rubbish."""
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
    """Messages whose indication has not come yet, and indications whose message has not."""

    def __init__(self) -> None:
        self._messages: OrderedDict[Key, tuple[float, Any]] = OrderedDict()
        self._indications: OrderedDict[Key, How] = OrderedDict()

    def message(self, key: Key, what: Any, now: float) -> How | None:
        """How it came, where that is known; else it waits."""
        how = self._indications.pop(key, None)
        if how is None:
            self._messages[key] = (now, what)
        return how

    def indication(self, key: Key, how: How) -> Any | None:
        """What waited for it."""
        found = self._messages.pop(key, None)
        if found is not None:
            return found[1]
        self._indications[key] = how
        if len(self._indications) > MOST:
            self._indications.popitem(last=False)
        return None

    def expired(self, now: float) -> list[Any]:
        """What has waited long enough."""
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
