"""The message library as the gateway uses it: an edition of a message with its ROS type, and what stays beside."""

from collections import OrderedDict, deque
from types import ModuleType
from typing import Any, NamedTuple

from .errors import GatewayError, RefusedError
from .handlers.kind import Kind

ITS_HEADER = 6  # octets: protocolVersion, messageID, stationID (TS 102 894-2, ItsPduHeader)
MAX_PDU = 1500  # octets, what a station takes
# Of a station's messages of a type; one that relays messages returns each before so many others have come.
KEPT_OF_A_STATION = 16
KEPT_STATIONS = 256
# Originals, of all stations, that a message which cannot be said is compared with: each costs an encoding.
MOST_TRIED = 64

INSTALL = (
    "install its wheel: captain-asn1 generate --all --form wheel --ros2 --to DIR, then "
    "python3 -m pip install DIR/*.whl in the environment of ROS; where that is refused as externally managed, with "
    "--user --break-system-packages"
)


def load() -> ModuleType:
    """captain_messages. Raises GatewayError where it is not there, or knows nothing of ROS."""
    try:
        import captain_messages
    except ImportError as error:
        raise GatewayError(f"there is no message library, captain_messages: {error}; {INSTALL}") from error
    if not hasattr(captain_messages, "CdrError"):
        raise GatewayError(f"{captain_messages.__file__} was generated without --ros2; {INSTALL}")
    library: ModuleType = captain_messages
    return library


class Made(NamedTuple):
    """A message as ROS has it. left_out: paths of what has no field there."""

    cdr: bytes
    left_out: tuple[str, ...]


class Edition:
    """One edition of a message in one profile.

    kind       whose paths are read, as far as this edition has them.
    has_forms  the other form of the message (form_of) is received as well.
    Raises GatewayError for a name that the library does not have, of another type, or that the profile cannot say.
    """

    def __init__(self, library: ModuleType, name: str, profile: str, kind: Kind, has_forms: bool = True) -> None:
        try:
            self.message: Any = library.find(name)
            self.ros_type: str = self.message.ros2_type(profile)
        except LookupError as error:
            raise GatewayError(f"{kind.name}.edition: {error.args[0] if error.args else error}") from error
        self.name: str = self.message.name
        if kind.editions and _type(self.name) not in map(_type, kind.editions):
            raise GatewayError(f"{kind.name}.edition: {self.name} is no edition of {_type(kind.editions[0])}")
        self.profile = profile
        # Editions whose header some octets may have instead, or as well.
        self._rivals = [one for one in library.all() if one.name != self.name and set(one.ids) & set(self.message.ids)]
        self.position = self._reader(next((pair for pair in kind.position if self._has(*pair)), ()))
        self.generated = self._reader(next(((path,) for path in kind.generated if self._has(path)), ()))
        self.key = self._reader(tuple(path for path in kind.key if self._has(path)))
        self._kept = Kept()
        others = _other_forms(library, self.message) if has_forms else []
        self._forms = [Edition(library, other, profile, kind, has_forms=False) for other in others]

    def of(self, pdu: bytes) -> "Edition":
        """Return the form of the message that fits a PDU; itself if neither fits. Both have one ROS type.

        If both give the octets back, the one that keeps every constraint, as in the station's own programs.
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
        """Octets of the air as a serialised ROS message. Raises RefusedError."""
        try:
            cdr, left_out = self.message.to_cdr(pdu, self.profile)
        except (ValueError, MemoryError) as error:
            raise RefusedError("undecodable", str(error)) from error
        if not left_out:
            return Made(cdr, ())
        self._kept.keep(pdu)
        return Made(cdr, tuple(part.path for part in left_out))

    def from_cdr(self, cdr: bytes) -> bytes:
        """A serialised ROS message as octets of the air: those that it was made of, where it still says the same.

        Raises RefusedError, which names the field, its value and what is allowed.
        """
        try:
            pdu: bytes = self.message.from_cdr(cdr, self.profile)
        except (ValueError, MemoryError) as error:
            if type(error).__name__ == "CdrError" and _is_broken(error):
                raise RefusedError("foreign", str(error)) from error
            # What no edition knows cannot be said in ROS: unless it is a message that came like this.
            for original in self._kept.newest():
                if self._is_made_of(cdr, original):
                    return original
            raise RefusedError("out-of-range", str(error)) from error
        for original in self._kept.of(pdu):
            if self._is_made_of(cdr, original):
                return original
        return pdu

    def check_header(self, pdu: bytes) -> None:
        """Refuse the header of another edition: the same octets mean other values there.

        pdu  at least 2 octets: protocolVersion and messageID.

        A protocolVersion that no edition of the messageID has is allowed. Raises RefusedError with the cause "edition".
        Source: ETSI TS 102 894-2 v2.4.1, DF ItsPduHeader.
        """
        named = "" if pdu[0] in self.message.versions else self._owners(pdu)
        if named:
            raise RefusedError("edition", f"header.protocol_version: {pdu[0]} selects {named}, not {self.name}")

    def others(self, pdu: bytes) -> tuple[str, ...]:
        """Return editions of the same header that give the octets back and decode to different values.

        An edition of the same type that knows fewer parts is not reported: its senders cannot encode those parts. One
        that cannot be read is reported. The station's own programs compare likewise: drivers/wire/editions.py.
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
        """Return the names of the editions whose header a PDU has; the -ext form has that of its message."""
        return " or ".join(one.name for one in self._of_header(pdu) if not one.form_of)

    def check(self, pdu: bytes) -> None:
        """Raise RefusedError for what a station would take for another message, or not at all."""
        if len(pdu) < ITS_HEADER:
            raise RefusedError("header", f"{len(pdu)} octets are no message: its header alone has {ITS_HEADER}")
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
        """Raise RefusedError, which names field and bit, for what a user has encoded and does not decode."""
        try:
            self.message.view(pdu)
        except (ValueError, MemoryError) as error:
            raise RefusedError("undecodable", str(error)) from error

    def is_exact(self, pdu: bytes) -> bool | None:
        """Return whether encoding it again gives the same octets; None if it does not decode."""
        try:
            return bool(self.message.encode(self.message.view(pdu)) == pdu)
        except (ValueError, MemoryError):
            return None

    def is_valid(self, pdu: bytes) -> bool:
        """Return whether a message keeps every constraint of the standard."""
        try:
            self.message.validate(pdu)
        except (ValueError, MemoryError):
            return False
        return True

    def unknown_parts(self, pdu: bytes) -> int:
        """Return the number of parts of a message that this edition does not know."""
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
    """Messages of which something has no place in ROS, by their station: the most recent of the most recent.

    The thread that receives writes, the one that sends reads: what it reads is a copy.
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
        """Those with this header, the newest first."""
        return list(self._stations.get(pdu[:ITS_HEADER], ()))[::-1]

    def newest(self) -> list[bytes]:
        """The newest of all, MOST_TRIED at most: those of the station that was heard last come first."""
        recent = list(self._stations.values())[-MOST_TRIED:][::-1]
        return [pdu for own in recent for pdu in list(own)[::-1]][:MOST_TRIED]


class Leaves(NamedTuple):
    """Values without field names, and the number of unknown parts. Not read: the values are unique."""

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
    """Return whether octets are no message of the type at all, in contrast to one with an invalid value."""
    reason = str(getattr(error, "reason", ""))
    return not getattr(error, "path", "") or reason.startswith(("truncated", "octets behind"))


def _other_forms(library: ModuleType, message: Any) -> list[str]:
    """Return the names of the other forms of a message."""
    strict = message.form_of or message.name
    forms = [one.name for one in library.all() if strict in (one.name, one.form_of)]
    return [name for name in forms if name != message.name]


def _type(edition: str) -> str:
    return edition.partition("-")[0]
