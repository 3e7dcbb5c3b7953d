"""Older schemas of Orange's its-client: converts their JSON to the structure of the newest schemas.

Schemas cam 1.1.3 and 2.0.0 have confidences in a separate object, and containers without the level of alternatives.
Schema cam 2.1 has optional members and bits as digits. Schemas denm before 2.2 have other names. Absent members get
the defaults of the schemas.
A value of an invalid kind stays unchanged: the reader of the newest structure refuses it with its path.
"""

from collections.abc import Callable
from typing import Any

Json = dict[str, Any]

_NEW = (2, 2)

_PAIRS = {  # members of the vehicle's container, with their value and confidence for unavailable
    "heading": (3601, 127),
    "speed": (16_383, 127),
    "vehicle_length": (1023, 4),
    "longitudinal_acceleration": (161, 102),
    "curvature": (1023, 7),
    "yaw_rate": (32_767, 8),
}
# Optional pairs of the same container.
_MORE_PAIRS = {"lateral_acceleration": (161, 102), "vertical_acceleration": (161, 102)}
_SINGLE = {"drive_direction": 2, "vehicle_width": 62, "curvature_calculation_mode": 2}
_ELLIPSE = {"semi_major": 4095, "semi_minor": 4095, "semi_major_orientation": 3601}
_DELTA = {"delta_latitude": 131_072, "delta_longitude": 131_072, "delta_altitude": 12_800}
_UNKNOWN_ALTITUDE = 800_001, 15
_CAR, _ROADSIDE = "basic_vehicle_container_high_frequency", "rsu_container_high_frequency"
_LIGHTS = "basic_vehicle_container_low_frequency"
_CONTAINERS = {
    "management_container": "management",
    "situation_container": "situation",
    "location_container": "location",
    "alacarte_container": "alacarte",
}
_RENAMED = {"relevance_distance": "awareness_distance", "relevance_traffic_direction": "traffic_direction"}


def renewed(kind: str, version: str, message: Json) -> Json:
    """Return the member `message` in the structure of the newest schema of its type.

    version  of the schema, such as "2.1.0"; text in another form counts as the newest version.
    """
    if numbers(version) >= _NEW:
        return message
    return {"cam": _cam, "denm": _denm}.get(kind, dict)(message)


def numbers(version: str) -> tuple[int, ...]:
    """Return (2, 1, 0) for "2.1.0"; parts that are not numbers count as the newest version."""
    return tuple(int(part) if part.isdecimal() and len(part) < 4 else 999 for part in version.split(".")[:3])


def _cam(message: Json) -> Json:
    found = dict(message)
    _change(found, "basic_container", _basic)
    _change(found, "high_frequency_container", _high)
    _change(found, "low_frequency_container", _low)
    _change(found, "special_vehicle_container", _special)
    return found


def _basic(container: Json) -> Json:
    found = {"station_type": 0, **container}
    confidence = found.pop("confidence", {})
    _change(found, "reference_position", lambda position: _position(position, confidence))
    return found


def _position(position: Json, confidence: Any) -> Json:
    given = confidence if isinstance(confidence, dict) else {}
    found = {"position_confidence_ellipse": given.get("position_confidence_ellipse", {}), **position}
    value, worst = _UNKNOWN_ALTITUDE
    found["altitude"] = _pair(found.get("altitude", {}), value, given.get("altitude", worst))
    _change(found, "position_confidence_ellipse", _ellipse)
    return found


def _ellipse(ellipse: Json) -> Json:
    return _ELLIPSE | {name.removesuffix("_confidence"): value for name, value in ellipse.items()}


def _high(container: Json) -> Json:
    if _ROADSIDE in container:
        return container
    if _CAR in container:
        found = dict(container)
        _change(found, _CAR, _car)
        return found
    return {_CAR: _car(container)}


def _car(container: Json) -> Json:
    found = {**_SINGLE, **container}
    confidence = found.pop("confidence", {})
    given = confidence if isinstance(confidence, dict) else {}
    for name, (value, worst) in (_PAIRS | _MORE_PAIRS).items():
        if name in _PAIRS or name in found:
            found[name] = _pair(found.get(name, {}), value, given.get(name, worst))
    if isinstance(found.get("steering_wheel_angle"), dict):
        found["steering_wheel_angle"] = _pair(found["steering_wheel_angle"], 512, 127)
    return found


def _low(container: Json) -> Json:
    found = dict(container) if _LIGHTS in container else {_LIGHTS: container}
    _change(found, _LIGHTS, lambda lights: _path({"vehicle_role": 0, **lights}, "path_history"))
    return found


def _special(container: Json) -> Json:
    found = {name: dict(item) if isinstance(item, dict) else item for name, item in container.items()}
    for item in found.values():
        if isinstance(item, dict):
            _change(item, "incident_indication", _incident)
            _change(item, "pt_activation", _activation)
    return found


def _incident(incident: Json) -> Json:
    cause = incident.get("cc_and_scc")
    return {**incident, "cc_and_scc": {"cause": cause}} if type(cause) is int else incident


def _activation(activation: Json) -> Json:
    found = {name.replace("-", "_"): value for name, value in activation.items()}
    return {"pt_activation_type": 0, **found}


def _denm(message: Json) -> Json:
    found = {_CONTAINERS.get(name, name): item for name, item in message.items()}
    _change(found, "management", _management)
    _change(found, "situation", lambda situation: {"information_quality": 0, **situation})
    _change(found, "location", _location)
    return found


def _management(container: Json) -> Json:
    found = {"station_type": 0, **{_RENAMED.get(name, name): item for name, item in container.items()}}
    confidence = found.pop("confidence", {})

    def event(position: Json) -> Json:
        position = dict(position)
        return _position(position, position.pop("confidence", confidence))

    _change(found, "event_position", event)
    return found


def _location(container: Json) -> Json:
    found = dict(container)
    confidence = found.pop("confidence", {})
    given = confidence if isinstance(confidence, dict) else {}
    for name in ("event_speed", "event_position_heading"):
        if name in found:
            value = found[name]
            if isinstance(value, dict):
                found[name] = {part.removeprefix("speed_"): item for part, item in value.items()}
            else:
                found[name] = _pair(value, value, given.get(name, 127))
    if "traces" in found:
        traces = found.pop("traces")
        found["detection_zones_to_event_position"] = (
            [{"path": zone.get("path_history")} if isinstance(zone, dict) else zone for zone in traces]
            if isinstance(traces, list)
            else traces
        )
    zones = found.get("detection_zones_to_event_position")
    if isinstance(zones, list):
        found["detection_zones_to_event_position"] = [
            _path(zone, "path") if isinstance(zone, dict) else zone for zone in zones
        ]
    return found


def _path(holder: Json, name: str) -> Json:
    """Return an object whose list of points has all members of each position."""

    def filled(point: Json) -> Json:
        return {**point, "path_position": {**_DELTA, **point["path_position"]}}

    points = holder.get(name)
    if not isinstance(points, list):
        return holder
    is_known = [isinstance(point, dict) and isinstance(point.get("path_position"), dict) for point in points]
    return {**holder, name: [filled(point) if known else point for point, known in zip(points, is_known, strict=True)]}


def _pair(value: Any, unavailable: int, confidence: Any) -> Json:
    """Return value and confidence of a number, or of an object that may lack one of them."""
    if isinstance(value, dict):
        return {"value": unavailable, "confidence": confidence, **value}
    return {"value": value, "confidence": confidence}


def _change(holder: Json, name: str, change: Callable[[Json], Json]) -> None:
    """Replace a member by its converted value, if it is an object."""
    if isinstance(holder.get(name), dict):
        holder[name] = change(holder[name])
