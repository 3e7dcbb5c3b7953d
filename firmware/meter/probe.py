"""Probes: well-formed messages of a type and size, each different."""

import json
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

import firmware
from board.runtime.errors import RequestError
from board.time.scales import generation_delta_time, its_time_ms, leap_seconds
from drivers.message import Position
from firmware.codec.library import Library
from firmware.meter.event import PROBES

MOST_ALTITUDES = 800_000  # TS 102 894-2, AltitudeValue: number of values from 0 on, in 0.01 m
NOWHERE = Position(900_000_001, 1_800_000_001)  # TS 102 894-2, Latitude and Longitude: unavailable
# Points of a trace make a message longer. Limits: points of one trace, and traces of one message.
LONGEST_TRACE = 40
MOST_TRACES = {"cam": 1, "denm": 7}


class Probes:
    """Generates probes.

    Each has a number: a DENM in its actionID, a CAM in its altitude, since a CAM's time repeats every 65 s.

    kind      cam or denm. A DENM cancels an event that never existed, so it warns of nothing.
    octets    minimum size, reached by a trace; None: without a trace.
    now_s     returns Unix time in seconds.
    position  position of a CAM; None: unavailable, so that no receiver takes it for a vehicle.

    Raises RequestError for another type, or a size that is not possible.
    """

    def __init__(
        self,
        library: Library,
        kind: str,
        octets: int | None,
        now_s: Callable[[], float],
        position: Position | None = None,
    ) -> None:
        if kind not in _MAKERS:
            raise RequestError(f"--probe: unknown type {kind!r}", f"use one of {', '.join(_MAKERS)}")
        self.kind = kind
        self._now_s = now_s
        self._base, name = _base(library, kind)
        self._message = library.find(name)
        if kind == "cam":
            _put(self._base, position)
        self._count = secrets.randbelow(MOST_ALTITUDES)  # random, so that probes of two meters differ
        self._trace = 0
        self._last_ms = -1
        if octets is not None:
            self._lengthen(octets)

    @property
    def octets(self) -> int:
        """Size of the next probe."""
        return len(self._made(self._count, 0))

    def next(self, station_id: int = PROBES, position: Position | None = None) -> bytes:
        """Return the next probe. A CAM may have another stationID and position."""
        now_s = self._now_s()
        # Each probe has a millisecond of its own, since two of one millisecond would be equal.
        self._last_ms = max(self._last_ms + 1, its_time_ms(now_s, leap_seconds(now_s)))
        self._count += 1
        if position is not None:
            _put(self._base, position)
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
    """Return the fields of a short message of this type from firmware/vectors.json, and its edition."""
    rows = json.loads((Path(firmware.__file__).parent / "vectors.json").read_bytes())
    octets = next(bytes.fromhex(row["hex"]) for row in rows if row["type"] == kind and row["octets"] == _BASES[kind])
    message = library.find(kind)
    return json.loads(message.to_json(octets)), message.name


_BASES = {"cam": 46, "denm": 43}


def _cam(value: dict[str, Any], count: int, its_ms: int, trace: int) -> None:
    value["cam"]["generationDeltaTime"] = generation_delta_time(its_ms)
    position = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    position["altitude"]["altitudeValue"] = count % MOST_ALTITUDES
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


def _put(value: dict[str, Any], position: Position | None) -> None:
    latitude, longitude = NOWHERE if position is None else position
    reference = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    reference.update(latitude=latitude, longitude=longitude)


def _trace(points: int) -> list[dict[str, object]]:
    position = {"deltaLatitude": 131072, "deltaLongitude": 131072, "deltaAltitude": 12800}  # all unavailable
    return [{"pathPosition": position, "pathDeltaTime": 1} for _ in range(points)]


_MAKERS: dict[str, Callable[[dict[str, Any], int, int, int], None]] = {"cam": _cam, "denm": _denm}
