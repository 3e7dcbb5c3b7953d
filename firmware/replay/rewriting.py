"""Rewriter of messages: changes stationID, times and positions in place.

In UPER, a number of a fixed range has a fixed width, so that changing it moves no other bit. The message library gives
the position of each field. The GeoNetworking headers of the frame are changed with the message.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, radians
from typing import NamedTuple

from board.runtime.errors import ProtocolError, RequestError
from board.time.scales import nearest_its_time_ms
from drivers.sim.track import METRES
from drivers.wire import frame as ethernet
from drivers.wire.geonet import packet as geonet_packet
from drivers.wire.geonet.header import LongPosition
from drivers.wire.geonet.packet import GeoArea, Packet
from firmware.codec.decoding import Decoder
from firmware.codec.identify import Identity
from firmware.codec.library import Step, load
from firmware.codec.reading import Pdu

STATION_IDS = frozenset({"StationID", "StationId"})
DELTA_TIMES = frozenset({"GenerationDeltaTime"})  # milliseconds modulo 65536
TIMES = frozenset({"TimestampIts"})  # milliseconds
MINUTES, SECONDS, MARKS = "MinuteOfTheYear", "DSecond", "TimeMark"  # SAE J2735 types in SPATEM and MAPEM
LATITUDE, LONGITUDE = "Latitude", "Longitude"

# UPER stores a number as its difference from the lower bound of its range (TS 102 894-2; 1e-7 degree).
_SOUTH, _WEST = -900_000_000, -1_800_000_000
_NO_LATITUDE, _NO_LONGITUDE = 1_800_000_001, 3_600_000_001
_MS_OF_MINUTE, _MINUTES_OF_YEAR, _MARKS_OF_HOUR = 60_000, 527_040, 36_000


@dataclass(frozen=True)
class Changes:
    """Requested changes.

    station_id  stationID for all messages; with is_added, the number added to each stationID.
    is_now      add the time between recording and replay to all times. A message without time of recording counts as
                recorded when it was generated.
    north_m     shift of all positions to the north in metres.
    east_m      shift of all positions to the east in metres.
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
    """Shift of times in ms, and of positions in metres."""

    ms: int
    north_m: float
    east_m: float


class Rewriting:
    """Applies changes to messages and their frames.

    Raises NoLibraryError if there are changes but no message library.
    """

    def __init__(self, changes: Changes) -> None:
        self._changes = changes
        self._decoder = None if changes.is_none else Decoder(load())

    def apply(self, one: Pdu, now_ns: int) -> Pdu:
        """Return a message with all changes applied; now_ns: Unix time in nanoseconds.

        Raises RequestError for a signed message, whose signature would become invalid, and for one that does not
        decode, since the places of its fields are unknown.
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
    """Octets as one number, in which fields of any width are read and written."""

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
    """Change the stationID of the header, and every field with the same stationID."""
    named = [step for step in steps if step.type in STATION_IDS]
    if changes.station_id is None or not named:
        return
    old = octets.get(named[0])
    new = (old * changes.is_added + changes.station_id) & 0xFFFFFFFF
    for step in named:
        if octets.get(step) == old:
            octets.put(step, new)


def _late_ms(one: Pdu, steps: Sequence[Step], now_ns: int) -> int:
    """Return the time in ms since a message was recorded.

    If no time of recording is known, returns the time since it was generated; 0 if that is unknown, too.
    """
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
    return nearest_its_time_ms(unix_ns / 1e9)


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
    """Shift latitudes and longitudes in 1e-7 degree; positions relative to them move along."""
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
    """Return the shift to the east in 1e-7 degree at a latitude in 1e-7 degree; limited near the poles."""
    return round(moved.east_m / (METRES * max(0.01, cos(radians(latitude / 1e7)))) * 1e7)


def _latitude(moved: int) -> int:
    """Return a latitude in 1e-7 degree. Raises RequestError if it is beyond a pole."""
    if abs(moved) > -_SOUTH:
        raise RequestError("its place would be beyond a pole", "shift it less")
    return moved


def _frame(one: Pdu, octets: bytes, moved: Moved) -> bytes:
    """Return the frame with the changed message and shifted position vectors.

    Raises RequestError if it is malformed.
    """
    parts = ethernet.unwrap(one.frame)
    assert isinstance(parts, ethernet.Ethernet)  # source.py yields only such frames
    try:
        packet = geonet_packet.parse(parts.packet)
    except ProtocolError as error:
        raise RequestError(f"{one.origin}: {error.message}") from error
    header = packet.payload[: len(packet.payload) - len(one.octets)]
    packet = packet._replace(extended=_extended(packet, moved), payload=header + octets)
    rest = parts.packet[len(geonet_packet.encode(packet)) :]  # octets after the payload stay
    return one.frame[: ethernet.HEADER] + geonet_packet.encode(packet) + rest


def _extended(packet: Packet, moved: Moved) -> geonet_packet.Extended | None:
    extended = packet.extended
    if extended is None or not hasattr(extended, "source"):
        return extended
    extended = extended._replace(source=_moved(extended.source, moved))
    if isinstance(extended, GeoArea):
        position = _moved(extended.source._replace(latitude=extended.latitude, longitude=extended.longitude), moved)
        extended = extended._replace(latitude=position.latitude, longitude=position.longitude)
    return extended


def _moved(source: LongPosition, moved: Moved) -> LongPosition:
    """Return a position vector with shifted time and position; an unknown position (0, 0) stays unknown."""
    timestamp = (source.timestamp + moved.ms) % (1 << 32)
    if (source.latitude, source.longitude) == (0, 0):
        return source._replace(timestamp=timestamp)
    longitude = (source.longitude + _east(moved, source.latitude) - _WEST) % -(2 * _WEST) + _WEST
    latitude = _latitude(source.latitude + _north(moved)) if moved.north_m else source.latitude
    return source._replace(timestamp=timestamp, latitude=latitude, longitude=longitude)
