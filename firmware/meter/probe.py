"""Messages of the meter's own: of a type and a size, well-formed, each another; their stationID says what they are."""

import json
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

import firmware
from board.errors import RequestError
from board.time import generation_delta_time, its_time_ms, leap_seconds
from drivers.message import Position
from firmware.codec.library import Library
from firmware.meter.event import PROBES

MOST_ALTITUDES = 800_000  # TS 102 894-2, AltitudeValue: so many from 0 on, in 0.01 m
NOWHERE = Position(900_000_001, 1_800_000_001)  # TS 102 894-2, Latitude and Longitude: unavailable
# Points of a trace make a message longer; so many has one at most, and so many traces a DENM.
LONGEST_TRACE = 40
MOST_TRACES = {"cam": 1, "denm": 7}


class Probes:
    """Makes them. Each has a number: a DENM in its actionID, a CAM in its altitude, for its time comes every 65 s anew.

    kind    cam or denm: types whose fields carry a time or a number, and traces that make them longer. A DENM is the
            cancellation of an event that never was: nobody is warned of anything.
    octets  at least so many; None: without a trace.
    place   of a CAM; None: nowhere, so that nobody takes it for a vehicle.

    Raises RequestError for a type that there is no probe of, or a size that it cannot have.
    """

    def __init__(
        self,
        library: Library,
        kind: str,
        octets: int | None,
        now_s: Callable[[], float],
        place: Position | None = None,
    ) -> None:
        if kind not in _MAKERS:
            raise RequestError(f"there is no probe of type {kind!r}", f"there are: {', '.join(_MAKERS)}")
        self.kind = kind
        self._now_s = now_s
        self._base, name = _base(library, kind)
        self._message = library.find(name)
        if kind == "cam":
            _put(self._base, place)
        self._count = secrets.randbelow(MOST_ALTITUDES)  # two meters' are not the same
        self._trace = 0
        self._last_ms = -1
        if octets is not None:
            self._lengthen(octets)

    @property
    def octets(self) -> int:
        """Of the next one."""
        return len(self._made(self._count, 0))

    def next(self, station_id: int = PROBES, place: Position | None = None) -> bytes:
        """Another one; of a CAM also of another station, at another place."""
        now_s = self._now_s()
        # Two of one millisecond would be the same message.
        self._last_ms = max(self._last_ms + 1, its_time_ms(now_s, leap_seconds(now_s)))
        self._count += 1
        if place is not None:
            _put(self._base, place)
        return self._made(self._count, self._last_ms, station_id)

    def _made(self, count: int, its_ms: int, station_id: int = PROBES) -> bytes:
        value = json.loads(json.dumps(self._base))
        value["header"]["stationID"] = station_id
        _MAKERS[self.kind](value, count, its_ms, self._trace)
        return self._message.from_json(json.dumps(value))

    def _lengthen(self, octets: int) -> None:
        while self.octets < octets:
            if self._trace == LONGEST_TRACE * MOST_TRACES[self.kind]:
                raise RequestError(
                    f"--size: a {self.kind} of the meter has at most {self.octets} octets, not {octets}",
                    "take fewer, or --probe denm, which may have more",
                )
            self._trace += 1


def _base(library: Library, kind: str) -> tuple[dict[str, Any], str]:
    """The fields of a short message of the lab test of this type, and its edition."""
    rows = json.loads((Path(firmware.__file__).parent / "vectors.json").read_bytes())
    octets = next(bytes.fromhex(row["hex"]) for row in rows if row["type"] == kind and row["octets"] == _BASES[kind])
    message = library.find(kind)
    return json.loads(message.to_json(octets)), message.name


_BASES = {"cam": 46, "denm": 43}


def _cam(value: dict[str, Any], count: int, its_ms: int, trace: int) -> None:
    value["cam"]["generationDeltaTime"] = generation_delta_time(its_ms)
    place = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    place["altitude"]["altitudeValue"] = count % MOST_ALTITUDES
    if trace:
        value["cam"]["camParameters"]["lowFrequencyContainer"] = {
            "basicVehicleContainerLowFrequency": {
                "vehicleRole": "default",
                "exteriorLights": "00",
                "pathHistory": _trace(trace),
            }
        }


def _denm(value: dict[str, Any], count: int, its_ms: int, trace: int) -> None:
    management = value["denm"]["management"]
    management["actionID"] = {"originatingStationID": PROBES, "sequenceNumber": count & 0xFFFF}
    management["detectionTime"] = management["referenceTime"] = its_ms
    if trace:
        whole, rest = divmod(trace, LONGEST_TRACE)
        value["denm"]["location"] = {"traces": [_trace(LONGEST_TRACE)] * whole + [_trace(rest)] * (rest > 0)}


def _put(value: dict[str, Any], place: Position | None) -> None:
    latitude, longitude = NOWHERE if place is None else place
    reference = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    reference.update(latitude=latitude, longitude=longitude)


def _trace(points: int) -> list[dict[str, object]]:
    place = {"deltaLatitude": 131072, "deltaLongitude": 131072, "deltaAltitude": 12800}  # all unavailable
    return [{"pathPosition": place, "pathDeltaTime": 1} for _ in range(points)]


_MAKERS: dict[str, Callable[[dict[str, Any], int, int, int], None]] = {"cam": _cam, "denm": _denm}
