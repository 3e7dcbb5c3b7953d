"""Editions of messages: conversion between PDUs and ROS messages, by the message library."""

from collections import OrderedDict, deque
from types import ModuleType
from typing import Any, NamedTuple

from .errors import GatewayError, RefusedError
from .handlers.kind import Kind

ITS_HEADER = 6  # octets of protocolVersion, messageID and stationID (TS 102 894-2, ItsPduHeader)
MAX_PDU = 1500  # octets, what a station takes
# Received messages kept per header (station and type), in case a ROS node relays them. It returns each before so
# many others have arrived.
KEPT_OF_A_STATION = 16
KEPT_STATIONS = 256
# Kept originals that a message which cannot be encoded is compared with. Each comparison costs an encoding.
MOST_TRIED = 64

INSTALL = (
    "install its wheel: captain-asn1 generate --all --format wheel --ros2 --to DIR, then "
    "python3 -m pip install DIR/*.whl in the environment of ROS; where that is refused as externally managed, with "
    "--user --break-system-packages"
)


def load() -> ModuleType:
    """Import captain_messages. Raises GatewayError if it is not installed or was generated without ROS 2 support."""
    try:
        import captain_messages
    except ImportError as error:
        raise GatewayError(f"captain_messages, the message library, is not installed: {error}; {INSTALL}") from error
    if not hasattr(captain_messages, "CdrError"):
        raise GatewayError(f"{captain_messages.__file__} was generated without --ros2; {INSTALL}")
    library: ModuleType = captain_messages
    return library


class Made(NamedTuple):
    """A message serialised for ROS. left_out: paths of fields that the ROS type lacks."""

    cdr: bytes
    left_out: tuple[str, ...]


class Edition:
    """One edition of a message, with its ROS type in a profile.

    kind       handler whose paths (position, time, key) are read, if this edition has them.
    has_forms  also accept the other form of the message (form_of): strict or -ext.

    Raises GatewayError for an unknown name, for one of another message type, and if the profile has no ROS type for it.
    """

    def __init__(self, library: ModuleType, name: str, profile: str, kind: Kind, has_forms: bool = True) -> None:
        try:
            self.message: Any = library.find(name)
            self.ros_type: str = self.message.ros2_type(profile)
        except LookupError as error:
            raise GatewayError(f"{kind.name}.edition: {error.args[0] if error.args else error}") from error
        self.name: str = self.message.name
        if kind.editions and _type(self.name) not in map(_type, kind.editions):
            raise GatewayError(f"{kind.name}.edition: {self.name} is not an edition of {_type(kind.editions[0])}")
        self.profile = profile
        # Other editions that share a messageID with this one.
        self._rivals = [one for one in library.all() if one.name != self.name and set(one.ids) & set(self.message.ids)]
        self.position = self._reader(next((pair for pair in kind.position if self._has(*pair)), ()))
        self.generated = self._reader(next(((path,) for path in kind.generated if self._has(path)), ()))
        self.key = self._reader(tuple(path for path in kind.key if self._has(path)))
        self._kept = Kept()
        others = _other_forms(library, self.message) if has_forms else []
        self._forms = [Edition(library, other, profile, kind, has_forms=False) for other in others]

    def of(self, pdu: bytes) -> "Edition":
        """Return the form of the message that fits a PDU; self if neither fits. Both have the same ROS type.

        If re-encoding gives the same octets with both, the form whose constraints all hold is returned. The station's
        own programs choose likewise.
        """
        if not self._forms:
            return self
        first = None
        for one in (self, *self._forms):
            if one.is_exact(pdu):
                if one.is_valid(pdu):
                    return one
                first = first or one
        return first or self

    def to_cdr(self, pdu: bytes) -> Made:
        """Convert a PDU to a serialised ROS message.

        A PDU with parts that ROS lacks is kept, so that from_cdr() can restore it.
        Raises RefusedError if this edition does not decode it.
        """
        try:
            cdr, left_out = self.message.to_cdr(pdu, self.profile)
        except (ValueError, MemoryError) as error:
            raise RefusedError("undecodable", str(error)) from error
        if not left_out:
            return Made(cdr, ())
        self._kept.keep(pdu)
        return Made(cdr, tuple(part.path for part in left_out))

    def from_cdr(self, cdr: bytes) -> bytes:
        """Convert a serialised ROS message to a PDU.

        If it equals a received message in all fields that ROS has, the received PDU is returned, with the parts ROS
        lacks.
        Raises RefusedError with the field, its value and the range.
        """
        try:
            pdu: bytes = self.message.from_cdr(cdr, self.profile)
        except (ValueError, MemoryError) as error:
            if type(error).__name__ == "CdrError" and _is_broken(error):
                raise RefusedError("foreign", str(error)) from error
            # Unknown extensions have no value in ROS. A relayed message that has them is restored from its original.
            for original in self._kept.newest():
                if self._is_made_of(cdr, original):
                    return original
            raise RefusedError("out-of-range", str(error)) from error
        for original in self._kept.of(pdu):
            if self._is_made_of(cdr, original):
                return original
        return pdu

    def check_header(self, pdu: bytes) -> None:
        """Raise RefusedError with cause "edition" if the header selects another edition: there the values differ.

        pdu  at least 2 octets: protocolVersion and messageID.

        A protocolVersion that no edition of this messageID has is accepted.
        Source: ETSI TS 102 894-2 v2.4.1, DF ItsPduHeader.
        """
        named = "" if pdu[0] in self.message.versions else self._owners(pdu)
        if named:
            raise RefusedError("edition", f"header.protocol_version: {pdu[0]} selects {named}, not {self.name}")

    def others(self, pdu: bytes) -> tuple[str, ...]:
        """Return the names of editions with the same header that also fit the PDU but decode it to different values.

        "Fit" means that encoding the decoded message again gives the same octets. An edition of the same type that
        knows fewer parts is omitted: its senders cannot encode those parts. An edition whose values cannot be listed is
        included. The station's own programs compare likewise: drivers/wire/editions.py.
        """
        rivals = self._of_header(pdu)
        if not rivals or pdu[0] not in self.message.versions:
            return ()
        own = _leaves(self.message, pdu)
        found = [(one, _leaves(one, pdu)) for one in rivals if _is_exact(one, pdu)]
        return tuple(
            one.name
            for one, other in found
            if other.values != own.values and not (one.type == self.message.type and _knows_less(other, own))
        )

    def _of_header(self, pdu: bytes) -> list[Any]:
        return [one for one in self._rivals if pdu[1] in one.ids and pdu[0] in one.versions]

    def _owners(self, pdu: bytes) -> str:
        """Return the names of the strict editions whose header the PDU has, joined by "or"."""
        return " or ".join(one.name for one in self._of_header(pdu) if not one.form_of)

    def check(self, pdu: bytes) -> None:
        """Raise RefusedError for a PDU with another edition's header, or a length that the station refuses."""
        if len(pdu) < ITS_HEADER:
            raise RefusedError("header", f"{len(pdu)} octets are too short; the header alone has {ITS_HEADER}")
        if pdu[1] not in self.message.ids:
            expected = " or ".join(map(str, self.message.ids))
            raise RefusedError("header", f"header.message_id: {pdu[1]} is not that of {self.message.type}: {expected}")
        if pdu[0] not in self.message.versions:
            expected = " or ".join(map(str, self.message.versions))
            owners = self._owners(pdu)
            told = f"header.protocol_version: {pdu[0]} is not that of {self.name}: {expected}"
            raise RefusedError("header", f"{told}; it selects {owners}" if owners else told)
        if len(pdu) > MAX_PDU:
            raise RefusedError("too-long", f"the message has {len(pdu)} octets; a station takes {MAX_PDU}")

    def check_body(self, pdu: bytes) -> None:
        """Raise RefusedError with field and bit if a user's PDU does not decode."""
        try:
            self.message.view(pdu)
        except (ValueError, MemoryError) as error:
            raise RefusedError("undecodable", str(error)) from error

    def is_exact(self, pdu: bytes) -> bool | None:
        """Return whether decoding and encoding again gives the same octets; None if it does not decode."""
        try:
            return bool(self.message.encode(self.message.view(pdu)) == pdu)
        except (ValueError, MemoryError):
            return None

    def is_valid(self, pdu: bytes) -> bool:
        """Return whether a message satisfies every constraint of its standard."""
        try:
            self.message.validate(pdu)
        except (ValueError, MemoryError):
            return False
        return True

    def unknown_parts(self, pdu: bytes) -> int:
        """Return the number of parts (extensions) of a message that this edition does not know."""
        return _leaves(self.message, pdu).unknown

    def _is_made_of(self, cdr: bytes, original: bytes) -> bool:
        try:
            return bool(self.message.from_cdr(cdr, self.profile, original) == original)
        except (ValueError, MemoryError):
            return False

    def _has(self, *paths: str) -> bool:
        try:
            self.message.reader(*paths)
        except ValueError:
            return False
        return True

    def _reader(self, paths: tuple[str, ...]) -> Any:
        return self.message.reader(*paths) if paths else None


class Kept:
    """Recently received messages with parts that ROS lacks, by station.

    It holds the last KEPT_OF_A_STATION messages of the last KEPT_STATIONS stations. The receiving thread adds messages;
    the executor's thread reads copies.
    """

    def __init__(self) -> None:
        self._stations: OrderedDict[bytes, deque[bytes]] = OrderedDict()

    def keep(self, pdu: bytes) -> None:
        station = pdu[:ITS_HEADER]
        own = self._stations.get(station)
        if own is None:
            own = self._stations[station] = deque(maxlen=KEPT_OF_A_STATION)
            if len(self._stations) > KEPT_STATIONS:
                self._stations.popitem(last=False)
        else:
            self._stations.move_to_end(station)
        if pdu not in own:
            own.append(pdu)

    def of(self, pdu: bytes) -> list[bytes]:
        """Return the kept messages with this header, newest first."""
        return list(self._stations.get(pdu[:ITS_HEADER], ()))[::-1]

    def newest(self) -> list[bytes]:
        """Return at most MOST_TRIED kept messages; those of the station heard last come first."""
        recent = list(self._stations.values())[-MOST_TRIED:][::-1]
        return [pdu for own in recent for pdu in list(own)[::-1]][:MOST_TRIED]


class Leaves(NamedTuple):
    """Concatenated values without field names, and the number of unknown parts.

    is_read  False if they could not be listed; `values` then holds the edition's name, which equals no other.
    """

    values: bytes
    unknown: int
    is_read: bool = True


def _leaves(message: Any, pdu: bytes) -> Leaves:
    try:
        return Leaves(*message.leaves(pdu))
    except (ValueError, MemoryError):
        return Leaves(message.name.encode(), len(pdu), is_read=False)


def _knows_less(other: Leaves, own: Leaves) -> bool:
    return other.is_read and other.unknown > own.unknown


def _is_exact(message: Any, pdu: bytes) -> bool:
    try:
        return bool(message.encode(message.view(pdu)) == pdu)
    except (ValueError, MemoryError):
        return False


def _is_broken(error: BaseException) -> bool:
    """Return whether the octets are malformed as a whole, in contrast to a message with an invalid value."""
    reason = str(getattr(error, "reason", ""))
    return not getattr(error, "path", "") or reason.startswith(("truncated", "octets behind"))


def _other_forms(library: ModuleType, message: Any) -> list[str]:
    """Return the names of the other forms of a message."""
    strict = message.form_of or message.name
    forms = [one.name for one in library.all() if strict in (one.name, one.form_of)]
    return [name for name in forms if name != message.name]


def _type(edition: str) -> str:
    return edition.partition("-")[0]
