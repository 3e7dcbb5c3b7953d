"""JSON schemas of Orange's its-client, and values that follow them.

They contain the facts of schema/cam/cam_schema_2-4-0.json and of the envelopes in schema/: members, required members,
types and bounds. Source: github.com/Orange-OpenSource/its-client, MIT, Copyright 2016-2022 Orange. All differences make
them stricter. Unknown members inside `message` are invalid here. In the original, the name of a member of
low_frequency_container ends with two blanks, so that its contents are not checked. The original has the version
"2.4.0-dev" of an unfinished schema; here it is the version in the file name.
"""

from typing import Any

from hypothesis import strategies as st

Schema = dict[str, Any]

TIMESTAMPS = 1_514_764_800_000, 1_830_297_600_000
ORIGINS = ("self", "global_application", "mec_application", "on_board_application")
VERSIONS = {"cam": "2.4.0", "denm": "2.3.0", "cpm": "2.1.1", "mapem": "2.0.0", "spatem": "2.0.0", "srem": "2.0.1"}
WITH_ORIGIN = frozenset({"mapem", "spatem"})

FLAG: Schema = {"type": "boolean"}
TEXT: Schema = {"type": "string"}


def whole(least: int, most: int) -> Schema:
    return {"type": "integer", "minimum": least, "maximum": most}


def record(required: dict[str, Schema], optional: dict[str, Schema] | None = None) -> Schema:
    """Return the schema of an object with these members and no others."""
    members = required | (optional or {})
    return {"type": "object", "required": list(required), "properties": members, "additionalProperties": False}


def choice(**members: Schema) -> Schema:
    """Return the schema of an object with exactly one of these members."""
    return {**record({}, members), "minProperties": 1, "maxProperties": 1}


def flags(*names: str) -> Schema:
    return record(dict.fromkeys(names, FLAG))


def several(item: Schema, least: int, most: int) -> Schema:
    return {"type": "array", "items": item, "minItems": least, "maxItems": most}


def pair(value: tuple[int, int], confidence: tuple[int, int]) -> Schema:
    return record({"value": whole(*value), "confidence": whole(*confidence)})


LATITUDE, LONGITUDE = whole(-900_000_000, 900_000_001), whole(-1_800_000_000, 1_800_000_001)
AXIS, ANGLE = whole(0, 4095), whole(0, 3601)
ACCELERATION = pair((-160, 161), (0, 102))
SIREN = flags("light_bar_activated", "siren_activated")
CAUSE = record({"cause": whole(0, 255), "subcause": whole(0, 255)})
INCIDENT = record({"cc_and_scc": CAUSE})
LANE_STATUS = whole(0, 2)

POSITION = record(
    {
        "latitude": LATITUDE,
        "longitude": LONGITUDE,
        "position_confidence_ellipse": record(
            {"semi_major": AXIS, "semi_minor": AXIS, "semi_major_orientation": ANGLE}
        ),
        "altitude": pair((-100_000, 800_001), (0, 15)),
    }
)
PEDALS = flags(
    "brake_pedal_engaged", "gas_pedal_engaged", "emergency_brake_engaged", "collision_warning_engaged", "acc_engaged",
    "cruise_control_engaged", "speed_limiter_engaged",
)  # fmt: skip
VEHICLE = record(
    {
        "heading": pair((0, 3601), (1, 127)),
        "speed": pair((0, 16_383), (1, 127)),
        "drive_direction": whole(0, 2),
        "vehicle_length": pair((1, 1023), (0, 4)),
        "vehicle_width": whole(1, 62),
        "longitudinal_acceleration": ACCELERATION,
        "curvature": pair((-1023, 1023), (0, 7)),
        "curvature_calculation_mode": whole(0, 2),
        "yaw_rate": pair((-32_766, 32_767), (0, 8)),
    },
    {
        "acceleration_control": PEDALS,
        "lane_position": whole(-1, 14),
        "steering_wheel_angle": pair((-511, 512), (1, 127)),
        "lateral_acceleration": ACCELERATION,
        "vertical_acceleration": ACCELERATION,
        "performance_class": whole(0, 7),
        "cen_dsrc_tolling_zone": record(
            {"protected_zone_latitude": LATITUDE, "protected_zone_longitude": LONGITUDE},
            {"cen_dsrc_tolling_zone_id": whole(0, 134_217_727)},
        ),
    },
)
ZONE = record(
    {"protected_zone_type": whole(0, 1), "protected_zone_latitude": LATITUDE, "protected_zone_longitude": LONGITUDE},
    {
        "expiry_time": whole(0, 4_398_046_511_103),
        "protected_zone_radius": whole(1, 255),
        "protected_zone_id": whole(0, 134_217_727),
    },
)
DELTA = whole(-131_071, 131_072)
PATH_POINT = record(
    {
        "path_position": record(
            {"delta_latitude": DELTA, "delta_longitude": DELTA, "delta_altitude": whole(-12_700, 12_800)}
        )
    },
    {"path_delta_time": whole(1, 65_535)},
)
LOW_FREQUENCY = record(
    {
        "vehicle_role": whole(0, 15),
        "exterior_lights": flags(
            "low_beam_headlights_on", "high_beam_headlights_on", "left_turn_signal_on", "right_turn_signal_on",
            "daytime_running_lights_on", "reverse_light_on", "fog_light_on", "parking_lights_on",
        ),
        "path_history": several(PATH_POINT, 0, 40),
    }
)  # fmt: skip
ACTIVATION = record(
    {"pt_activation_type": whole(0, 255), "pt_activation_data": {**TEXT, "minLength": 1, "maxLength": 20}}
)
CLOSED_LANES = record(
    {},
    {
        "inner_hard_shoulder_status": LANE_STATUS,
        "outer_hard_shoulder_status": LANE_STATUS,
        "driving_lane_status": flags(*(f"lane_{number}_closed" for number in range(1, 14))),
    },
)
SPECIAL = choice(
    public_transport_container=record({"embarkation_status": FLAG}, {"pt_activation": ACTIVATION}),
    special_transport_container=record(
        {
            "special_transport_type": flags("heavy_load", "excess_width", "excess_length", "excess_height"),
            "light_bar_siren_in_use": SIREN,
        }
    ),
    dangerous_goods_container=record({"dangerous_goods_basic": whole(0, 19)}),
    road_works_container_basic=record(
        {"light_bar_siren_in_use": SIREN}, {"road_works_sub_cause_code": whole(0, 255), "closed_lanes": CLOSED_LANES}
    ),
    rescue_container=record({"light_bar_siren_in_use": SIREN}),
    emergency_container=record(
        {"light_bar_siren_in_use": SIREN},
        {
            "incident_indication": INCIDENT,
            "emergency_priority": flags("request_for_right_of_way", "request_for_free_crossing_at_a_traffic_light"),
        },
    ),
    safety_car_container=record(
        {"light_bar_siren_in_use": SIREN},
        {"incident_indication": INCIDENT, "traffic_rule": whole(0, 4), "speed_limit": whole(1, 255)},
    ),
)
CAM = record(
    {
        "protocol_version": whole(0, 255),
        "station_id": whole(0, 4_294_967_295),
        "generation_delta_time": whole(0, 65_535),
        "basic_container": record({"station_type": whole(0, 255), "reference_position": POSITION}),
        "high_frequency_container": choice(
            basic_vehicle_container_high_frequency=VEHICLE,
            rsu_container_high_frequency=record({}, {"protected_communication_zones_rsu": several(ZONE, 1, 16)}),
        ),
    },
    {
        "low_frequency_container": record({"basic_vehicle_container_low_frequency": LOW_FREQUENCY}),
        "special_vehicle_container": SPECIAL,
    },
)
CODED = record({"version": TEXT, "payload": TEXT})  # the PDU in base64; only cam and mcm have it


def envelope(kind: str, topic: str = "", message: Schema = CODED) -> Schema:
    """Return the schema of a type's envelope. topic: name of the type in topics, if it differs."""
    version = {"const": VERSIONS[kind]} if kind in VERSIONS else TEXT
    origin: dict[str, Schema] = {"origin": {"enum": list(ORIGINS)}} if kind in WITH_ORIGIN else {}
    return record(
        {
            "message_type": {"const": topic or kind},
            "source_uuid": TEXT,
            "timestamp": whole(*TIMESTAMPS),
            "version": version,
            **origin,
            "message": message,
        },
        {"message_format": {"enum": ["json/raw", "asn1/uper"]}},
    )


def following(schema: Schema) -> st.SearchStrategy[Any]:
    """Return a strategy for valid values of a schema."""
    match schema["type"]:
        case "integer":
            return st.integers(schema["minimum"], schema["maximum"])
        case "boolean":
            return st.booleans()
        case "string":
            return st.text("VDV 50149", min_size=schema.get("minLength", 0), max_size=schema.get("maxLength", 20))
        case "array":
            most = min(schema["maxItems"], schema["minItems"] + 3)
            return st.lists(following(schema["items"]), min_size=schema["minItems"], max_size=most)
    members = {name: following(one) for name, one in schema["properties"].items()}
    if "maxProperties" in schema:
        return st.one_of([st.fixed_dictionaries({name: one}) for name, one in members.items()])
    required = {name: members.pop(name) for name in schema["required"]}
    return st.fixed_dictionaries(required, optional=members)
