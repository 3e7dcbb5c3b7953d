"""Names and bounds of Orange's JSON that cannot be derived from the ASN.1.

All other names follow a rule: snake_case of the field's name; value and confidence for a pair.

Source: the schemas cam 2.4.0, denm 2.3.0, cpm 2.1.1, spatem 2.0.0 and mapem 2.0.0 of its-client. Misspelled names are
misspelled there.
"""

import re
from functools import lru_cache

from drivers.wire.type_tree import Field, Type
from drivers.wire.v2n.payload.si import ConversionError, element_of

RAW = ("cam", "denm", "cpm", "spatem", "mapem")  # types with a conversion to JSON

# Names in the schema by the ASN.1 field, or by type and field.
NAMES = {
    "roadworksSubCauseCode": "road_works_sub_cause_code",
    "innerhardShoulderStatus": "inner_hard_shoulder_status",
    "outerhardShoulderStatus": "outer_hard_shoulder_status",
    "vDS": "v_d_s",
    "relevanceDistance": "awareness_distance",  # field of DENM of release 1
    "relevanceTrafficDirection": "traffic_direction",
    "eventHistory": "event_zone",
    "traces": "detection_zones_to_event_position",
    "timeStamp": "timestamp",
    "RectangularShape.shapeReferencePoint": "center_point",
    "horizontalOpeningAngleStart": "stationary_horizontal_opening_angle_start",
    "horizontalOpeningAngleEnd": "stationary_horizontal_opening_angle_end",
    "roadsegment": "road_segment",
    "vehicleSubClass": "vehicle",
    "vruSubClass": "vru",
    "groupSubClass": "group",
    "otherSubClass": "other",
    "VruProfileAndSubprofile.motorcyclist": "motorcylist",
    "offsetXaxis": "offset_x_axis",
    "offsetYaxis": "offset_y_axis",
    "scaleXaxis": "scale_x_axis",
    "scaleYaxis": "scale_y_axis",
    "Position3D.lat": "latitude",
    "Position3D.long": "longitude",
    "Connection.remoteIntersection": "remote_intersections",
    "Connection.userClass": "restriction_class_id",
}
# Names of members, by the prefix of the first one.
SEQUENCES = {"semiMajorC": ("semi_major", "semi_minor", "semi_major_orientation")}
SEQUENCES["semiMajorAxisLength"] = SEQUENCES["semiMajorC"]
NO_PAIR = frozenset({"ObjectClassWithConfidence"})  # types with a confidence as second member that keep their own names
# Components that have no object of their own: their members are in the enclosing object.
INLINE = frozenset({"camParameters"})
CONTAINERS = {  # containers of a CPM, by containerId
    1: "originating_vehicle_container",
    2: "originating_rsu_container",
    3: "sensor_information_container",
    4: "perception_region_container",
    5: "perceived_object_container",
}
# Bit strings are objects of flags, except in these types of messages. SETS: arrays of the ASN.1 names. MASKS:
# numbers with the first bit as bit 0.
SETS, MASKS = frozenset({"spatem", "mapem"}), frozenset({"denm"})
# Enumerations that are written as names of items; all others are numbers. ITEMS have another name in the schema,
# NO_ITEMS are not in the schema.
WORDS = frozenset({"LayerType", "SpeedLimitType", "NodeAttributeXY", "SegmentAttributeXY", "RestrictionAppliesTo"})
ITEMS = {
    "loadingzoneOnLeft": "loadingZoneOnLeft",
    "loadingzoneOnRight": "loadingZoneOnRight",
    "sidewalk-RevocableLane": "sidewalkRevocableLane",
    "median-RevocableLane": "medianRevocableLane",
}
NO_ITEMS = frozenset({"generalMapData", "reserved1"})
NOT_EMPTY = frozenset({"LaneDirection"})  # bit strings with at least one bit set

# Types that cannot be converted, with the cause.
REFUSED = {
    "ItineraryPath": "the schema has positions relative to the event's",
    "LowerTriangularPositiveSemidefiniteMatrices": "the schema has a dimension more than the message",
    "LaneDataAttributeList": "the schema has all alternatives in each item",
}
# Largest number or size in the schema, if the ASN.1 allows more.
MOST = {
    "traffic_flow_rule": 3,
    "positioning_solution": 6,
    "emergency_action_code": 4,
    "semi_length": 102,
    "semi_breadth": 102,
}


def is_wrapped(kind: str) -> bool:
    """Return True if causes are in a member cc_and_scc."""
    return kind == "cam"


TEXTS = ("IA5String", "UTF8String", "NumericString", "VisibleString", "PrintableString")
NO_FORM = 'has no form in "json/raw"'
FINE = -30_000  # smallest CurvatureValue of TS 102 894-2 V1.2.1
_WORDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|-")
_KEPT = 4096  # cached types and names; the messages of RAW have 1,500
_FROM_OUTSIDE = ("outermostDrivingLane", 1)  # item of LanePosition of V1.2.1


def check_edition(kind: str, body: Type) -> None:
    """Check the edition. Raises ConversionError for a CPM of TR 103 562, for which the profile has no form."""
    if kind == "cpm" and body.name != "CpmPayload":
        raise ConversionError("message", f"CPM of TR 103 562 {NO_FORM}")


@lru_cache(_KEPT)
def members_of(kind: Type) -> dict[str, Field]:
    """Return the components of a SEQUENCE by their names in the schema."""
    fields = list(kind.fields)
    names = [name_of(kind, field) for field in fields]
    if len(fields) == 2 and "onfidence" in fields[1].name and kind.name not in NO_PAIR:
        names = ["value", "confidence"]
    for beginning, others in SEQUENCES.items():
        if len(fields) == len(others) and fields[0].name.startswith(beginning):
            names = list(others)
    return dict(zip(names, fields, strict=True))


def name_of(kind: Type, field: Field) -> str:
    return NAMES.get(f"{kind.name}.{field.name}") or NAMES.get(field.name) or snake(field.name)


@lru_cache(_KEPT)
def snake(name: str) -> str:
    return NAMES.get(name) or _WORDS.sub("_", name).lower()


def open_type_of(containers: Field) -> Type:
    return element_of(containers.type).fields[1].type


def check_form(kind: Type, path: str) -> None:
    """Raise ConversionError for a type that cannot be represented in "json/raw"."""
    if why := REFUSED.get(kind.name or ""):
        raise ConversionError(path, f'is not converted to or from "json/raw": {why}')


def is_fine(kind: Type, path: str) -> bool:
    """Return True for CurvatureValue of V1.2.1. Raises ConversionError for LanePosition of V1.2.1."""
    if _FROM_OUTSIDE in kind.names:
        why = "it counts from the outermost lane, the schema from the innermost"
        raise ConversionError(path, f"LanePosition of CAM V1.3.2 cannot be converted: {why}")
    return kind.name == "CurvatureValue" and kind.low == FINE


def is_sized(kind: Type) -> bool:
    """Return True for a CHOICE of a number in two sizes, small and large."""
    return [field.name for field in kind.fields] == ["small", "large"]


@lru_cache(_KEPT)
def numbers_of(kind: Type) -> dict[str, int]:
    """Return the items of an enumeration, by name."""
    return dict(kind.names)


@lru_cache(_KEPT)
def names_of(kind: Type) -> dict[int, str]:
    """Return the items of an enumeration, by number."""
    return {number: name for name, number in kind.names}


@lru_cache(_KEPT)
def words_of(kind: Type) -> dict[str, str]:
    """Return the names in the schema of an enumeration's items, or of named bits, by their ASN.1 names."""
    return {name: ITEMS.get(name, name) for name, _ in kind.names if name not in NO_ITEMS}


@lru_cache(_KEPT)
def bit_names(kind: Type) -> list[tuple[str, int]]:
    if kind.names:
        return list(kind.names)
    return [(f"lane_{at + 1}_closed", at) for at in range(kind.high or 0)] if kind.name == "DrivingLaneStatus" else []


def size_of(kind: Type, places: list[int]) -> int:
    """Return the length in bits of a bit string with these bits set, if its type does not fix the length."""
    return max([kind.low or 0, *(at + 1 for _, at in kind.names), *(at + 1 for at in places)])
