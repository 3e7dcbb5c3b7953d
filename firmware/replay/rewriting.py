"""Messages of another station, of now, or of elsewhere: fields changed where they stand among the bits.

In UPER a number of a fixed range has a fixed width: changing it moves nothing else, so that every other bit stays as
it was recorded. The library says where each stands. The headers of GeoNetworking around a message change with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, radians
from typing import NamedTuple

from board.errors import ProtocolError, RequestError
from board.time import leap_seconds, nearest_its_time_ms
from drivers.sim.track import METRES
from drivers.wire import frame as ethernet
from drivers.wire import geonet_packet
from drivers.wire.geonet_header import LongPosition
from drivers.wire.geonet_packet import GeoArea, Packet
from firmware.codec.decoding import Decoder
from firmware.codec.identify import Identity
from firmware.codec.library import Step, load
from firmware.codec.reading import Pdu

STATION_IDS = frozenset({"StationID", "StationId"})
DELTA_TIMES = frozenset({"GenerationDeltaTime"})  # ms modulo 65536
TIMES = frozenset({"TimestampIts"})  # ms
MINUTES, SECONDS, MARKS = "MinuteOfTheYear", "DSecond", "TimeMark"  # of SAE J2735, in SPATEM and MAPEM
LATITUDE, LONGITUDE = "Latitude", "Longitude"

# How numbers stand in the bits: from the lower bound of their range on (TS 102 894-2; 1e-7 degree).
_SOUTH, _WEST = -900_000_000, -1_800_000_000
_NO_LATITUDE, _NO_LONGITUDE = 1_800_000_001, 3_600_000_001
_MS_OF_MINUTE, _MINUTES_OF_YEAR, _MARKS_OF_HOUR = 60_000, 527_040, 36_000


@dataclass(frozen=True)
class Changes:
    """What becomes another.

    station_id   the number of all stations; with is_added, what is added to each.
    is_now       times move by as much as lies between recording and replay. What has no time of recording is made as
                 if it had been recorded when it was generated.
    north_m, east_m  how far every place moves.
    """

    station_id: int | None = None
    is_added: bool = False
    is_now: bool = False
    north_m: float = 0.0
    east_m: float = 0.0

    @property
    def is_none(self) -> bool:
        return self == Changes()


class Moved(NamedTuple):
    """By how much: ms, metres."""

    ms: int
    north_m: float
    east_m: float


class Rewriting:
    """Changes messages, and the frames around them. Raises NoLibraryError where they are to be changed without one."""

    def __init__(self, changes: Changes) -> None:
        self._changes = changes
        self._decoder = None if changes.is_none else Decoder(load())

    def apply(self, one: Pdu, now_ns: int) -> Pdu:
        """The same as of now (Unix time). Raises RequestError that says why that cannot be.

        A signed one would not be what was signed; what does not decode has its fields nobody knows where.
        """
        if self._decoder is None:
            return one
        if one.carried.startswith("signed"):
            raise RequestError(f"{one.origin}: it is signed: changed, it would be a forgery")
        steps = _steps(one, self._decoder) if one.octets else []
        changes = self._changes
        moved = Moved(_late_ms(one, steps, now_ns) if changes.is_now else 0, changes.north_m, changes.east_m)
        octets = _Bits(one.octets)
        _station(octets, steps, changes)
        _times(octets, steps, moved.ms)
        _places(octets, steps, moved)
        changed = bytes(octets)
        return one._replace(octets=changed, frame=_frame(one, changed, moved) if one.frame else b"")


def _steps(one: Pdu, decoder: Decoder) -> Sequence[Step]:
    found = decoder.find(one.octets, is_quick=True)
    if not isinstance(found, Identity):
        raise RequestError(f"{one.origin}: it does not decode: {found.why if found.nearest is None else found.nearest}")
    return [step for step in found.message.explain(one.octets) if step.what == "value"]


class _Bits:
    """Octets as one number, of which stretches are read and written."""

    def __init__(self, octets: bytes) -> None:
        self._size = len(octets)
        self._number = int.from_bytes(octets)

    def __bytes__(self) -> bytes:
        return self._number.to_bytes(self._size)

    def get(self, step: Step) -> int:
        return self._number >> self._shift(step) & (1 << step.width) - 1

    def put(self, step: Step, value: int) -> None:
        mask = (1 << step.width) - 1
        self._number = self._number & ~(mask << self._shift(step)) | (value & mask) << self._shift(step)

    def _shift(self, step: Step) -> int:
        return self._size * 8 - step.bit - step.width


def _station(octets: _Bits, steps: Sequence[Step], changes: Changes) -> None:
    """That of the header, and of every field that names the same station."""
    named = [step for step in steps if step.type in STATION_IDS]
    if changes.station_id is None or not named:
        return
    old = octets.get(named[0])
    new = (old * changes.is_added + changes.station_id) & 0xFFFFFFFF
    for step in named:
        if octets.get(step) == old:
            octets.put(step, new)


def _late_ms(one: Pdu, steps: Sequence[Step], now_ns: int) -> int:
    """How much later than recorded, or than generated where that is all that is known."""
    now = _its_ms(now_ns)
    if one.when_ns is not None:
        return now - _its_ms(one.when_ns)
    octets = _Bits(one.octets)
    for step in steps:
        if step.type in TIMES:
            return now - octets.get(step)
        if step.type in DELTA_TIMES:
            return (now - octets.get(step)) % 65536
    return 0


def _its_ms(unix_ns: int) -> int:
    utc_s = unix_ns / 1e9
    return nearest_its_time_ms(utc_s, leap_seconds(utc_s))


def _times(octets: _Bits, steps: Sequence[Step], late_ms: int) -> None:
    minute: Step | None = None
    for step in steps if late_ms else ():
        value = octets.get(step)
        if step.type in DELTA_TIMES:
            octets.put(step, (value + late_ms) % 65536)
        elif step.type in TIMES:
            octets.put(step, max(0, min(value + late_ms, (1 << 42) - 1)))
        elif step.type == MINUTES and value < _MINUTES_OF_YEAR:
            minute = step
            octets.put(step, (value + late_ms // _MS_OF_MINUTE) % _MINUTES_OF_YEAR)
        elif step.type == SECONDS and value < _MS_OF_MINUTE:
            carry, left = divmod(value + late_ms % _MS_OF_MINUTE, _MS_OF_MINUTE)
            octets.put(step, left)
            if carry and minute is not None:
                octets.put(minute, (octets.get(minute) + carry) % _MINUTES_OF_YEAR)
        elif step.type == MARKS and value < _MARKS_OF_HOUR:
            octets.put(step, (value + round(late_ms / 100)) % _MARKS_OF_HOUR)


def _places(octets: _Bits, steps: Sequence[Step], moved: Moved) -> None:
    """Places of 1e-7 degree; what is told relative to them moves along."""
    latitude = 0
    for step in steps if moved.north_m or moved.east_m else ():
        value = octets.get(step)
        if step.type == LATITUDE and value != _NO_LATITUDE:
            latitude = value + _SOUTH
            octets.put(step, _latitude(value + _north(moved) + _SOUTH) - _SOUTH)
        elif step.type == LONGITUDE and value != _NO_LONGITUDE:
            octets.put(step, (value + _east(moved, latitude)) % (_NO_LONGITUDE - 1))


def _north(moved: Moved) -> int:
    return round(moved.north_m / METRES * 1e7)


def _east(moved: Moved, latitude: int) -> int:
    """Of a place at a latitude in 1e-7 degree; near a pole there is no east."""
    return round(moved.east_m / (METRES * max(0.01, cos(radians(latitude / 1e7)))) * 1e7)


def _latitude(moved: int) -> int:
    """In 1e-7 degree. Raises RequestError where there is none."""
    if abs(moved) > -_SOUTH:
        raise RequestError("its place would be beyond a pole", "shift it less")
    return moved


def _frame(one: Pdu, octets: bytes, moved: Moved) -> bytes:
    """The frame with the message changed inside, and its position vectors with it. Raises RequestError."""
    parts = ethernet.unwrap(one.frame)
    assert isinstance(parts, ethernet.Ethernet)  # source.py gives no other
    try:
        packet = geonet_packet.parse(parts.packet)
    except ProtocolError as error:
        raise RequestError(f"{one.origin}: {error.message}") from error
    header = packet.payload[: len(packet.payload) - len(one.octets)]
    packet = packet._replace(extended=_extended(packet, moved), payload=header + octets)
    rest = parts.packet[len(geonet_packet.encode(packet)) :]  # what stands behind the payload stays
    return one.frame[: ethernet.HEADER] + geonet_packet.encode(packet) + rest


def _extended(packet: Packet, moved: Moved) -> geonet_packet.Extended | None:
    extended = packet.extended
    if extended is None or not hasattr(extended, "source"):
        return extended
    extended = extended._replace(source=_moved(extended.source, moved))
    if isinstance(extended, GeoArea):
        place = _moved(extended.source._replace(latitude=extended.latitude, longitude=extended.longitude), moved)
        extended = extended._replace(latitude=place.latitude, longitude=place.longitude)
    return extended


def _moved(source: LongPosition, moved: Moved) -> LongPosition:
    """A place of 0, 0 is one that nobody knows, and stays it."""
    timestamp = (source.timestamp + moved.ms) % (1 << 32)
    if (source.latitude, source.longitude) == (0, 0):
        return source._replace(timestamp=timestamp)
    longitude = (source.longitude + _east(moved, source.latitude) - _WEST) % -(2 * _WEST) + _WEST
    latitude = _latitude(source.latitude + _north(moved)) if moved.north_m else source.latitude
    return source._replace(timestamp=timestamp, latitude=latitude, longitude=longitude)
