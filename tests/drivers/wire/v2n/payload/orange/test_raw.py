"""CAMs as JSON in Orange's envelope, compared with the members of its schema."""

import json
from typing import Any

import captain_messages
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from board.runtime.errors import RequestError
from drivers.mqtt.profile import load
from drivers.reason import Reason
from drivers.wire.v2n.description import ProfileDescription, PublishRow, SubscribeRow
from drivers.wire.v2n.profile import Delivery, Profile, ReceivedPdu, RefusedError
from tests.drivers.wire.v2n.payload.orange import schema
from tests.drivers.wire.v2n.station import HERE, NOW_MS, PDU, VECTORS, changed, profile

CAMS = [pdu for kind, pdu in VECTORS if kind == "cam"]
DESCRIPTION = ProfileDescription(
    "raw", (PublishRow("in/{type}", "orange-raw"),), (SubscribeRow("in/{type}", "orange-raw"),),
    types=load("orange").types,
)  # fmt: skip

SCHEMA = schema.envelope("cam", message=schema.CAM)
VALIDATOR = Draft202012Validator(SCHEMA)

# protocolVersions of CAMs. Containers that json/raw cannot carry in both directions are refused with their path.
VERSIONS = (1, 2)
# CAM V1.3.2 has no temporary zones, and counts lanes from the outermost one.
# TS 102 894-2 V1.2.1: ClosedLanes has one hard shoulder and a mandatory drivingLaneStatus, TrafficRule no fourth value.
LEFT_OUT_OF_1 = {"protected_zone_type", "lane_position", "closed_lanes", "traffic_rule"}
LEFT_OUT = {"pt_activation"}  # its text may have unprintable characters

FIRST: dict[str, Any] = {
    "protocol_version": 2,
    "station_id": 42,
    "generation_delta_time": 1245,
    "basic_container": {
        "station_type": 5,
        "reference_position": {
            "latitude": 470_707_000,
            "longitude": 154_395_000,
            "position_confidence_ellipse": {"semi_major": 150, "semi_minor": 4095, "semi_major_orientation": 3601},
            "altitude": {"value": 35_320, "confidence": 15},
        },
    },
    "high_frequency_container": {
        "basic_vehicle_container_high_frequency": {
            "heading": {"value": 923, "confidence": 127},
            "speed": {"value": 1389, "confidence": 50},
            "drive_direction": 0,
            "vehicle_length": {"value": 42, "confidence": 4},
            "vehicle_width": 18,
            "longitudinal_acceleration": {"value": -4, "confidence": 102},
            "curvature": {"value": 1023, "confidence": 7},
            "curvature_calculation_mode": 2,
            "yaw_rate": {"value": -125, "confidence": 8},
        }
    },
}


HIGH = "high_frequency_container"
CAR = f"{HIGH}.basic_vehicle_container_high_frequency"


def station(uuid: str = "com_car_1") -> Profile:
    return profile(DESCRIPTION, uuid=uuid)


def sent(pdu: bytes) -> dict[str, Any]:
    (found,) = station("com_car_2").publications("cam", 2001, pdu, HERE, NOW_MS)
    envelope: dict[str, Any] = json.loads(found.payload)
    return envelope


def taken(message: dict[str, Any], **changes: Any) -> ReceivedPdu:
    envelope = {
        "message_type": "cam",
        "message_format": "json/raw",
        "source_uuid": "com_car_2",
        "timestamp": NOW_MS,
        "version": "2.4.0",
        "message": message,
    }
    return station().receive(Delivery("in/cam", json.dumps(envelope | changes).encode()))


@pytest.mark.parametrize("pdu", CAMS)
def test_cams_of_other_implementations_come_back(pdu: bytes):
    assert taken(sent(pdu)["message"]) == ReceivedPdu(pdu, None, "com_car_2")


@pytest.mark.parametrize("pdu", CAMS)
def test_cams_of_other_implementations_are_written_as_the_schema_says(pdu: bytes):
    VALIDATOR.validate(sent(pdu))


def test_the_schema_is_one_and_refuses_what_it_does_not_name():
    Draft202012Validator.check_schema(SCHEMA)
    envelope = sent(CAMS[0])
    for path, value in (("station_id", 1 << 32), ("station_id", ...), ("basic_container.more", 1)):
        assert not VALIDATOR.is_valid(envelope | {"message": changed(envelope["message"], path, value)})
    assert not VALIDATOR.is_valid(envelope | {"more": 1})


@given(schema.following(schema.CAM), st.sampled_from(VERSIONS))
def test_every_cam_of_the_schema_is_taken_and_written_again_as_it_was(message: dict[str, Any], version: int):
    message["protocol_version"] = version
    try:
        pdu = taken(message).pdu
    except RefusedError as error:
        names = LEFT_OUT | LEFT_OUT_OF_1 if version == 1 else LEFT_OUT
        said = error.message.replace("closedLanes", "closed_lanes")
        assert any(name in json.dumps(message) and name in said for name in names)
        return
    again = sent(pdu)
    VALIDATOR.validate(again)
    assert again["message"] == message


@pytest.mark.parametrize(
    ("closed", "says"),
    [({}, "closedLanes.drivingLaneStatus: missing"), ({"inner_hard_shoulder_status": 1}, "inner_hard_shoulder_status")],
)
def test_closed_lanes_that_version_1_cannot_have_are_refused_with_their_path(closed: dict[str, Any], says: str):
    works = {"light_bar_siren_in_use": {"light_bar_activated": True, "siren_activated": False}, "closed_lanes": closed}
    message = FIRST | {"special_vehicle_container": {"road_works_container_basic": works}}
    assert sent(taken(message).pdu)["message"] == message
    with pytest.raises(RefusedError, match=says):
        taken(message | {"protocol_version": 1})


def test_a_cam_that_follows_the_schema_is_taken():
    value: Any = captain_messages.find("cam").decode(taken(FIRST).pdu)
    assert value["header"] == {"protocolVersion": 2, "messageID": 2, "stationID": 42}
    _, vehicle = value["cam"]["camParameters"]["highFrequencyContainer"]
    assert vehicle["speed"] == {"speedValue": 1389, "speedConfidence": 50}
    assert vehicle["driveDirection"] == "forward"


def of_version_1(message: dict[str, Any]) -> dict[str, Any]:
    """Return the value of a CAM V1.3.2 from the JSON."""
    pdu = taken(message | {"protocol_version": 1}).pdu
    value: dict[str, Any] = captain_messages.find("cam-1.3.2").decode(pdu)
    assert pdu[:2] == b"\x01\x02"
    return value


@pytest.mark.parametrize(("raw", "fine"), [(1023, 30_001), (1022, 3066), (-1023, -3069), (0, 0), (-74, -222)])
def test_protocol_version_1_is_encoded_as_cam_1_3_2_with_its_unit_of_curvature(raw: int, fine: int):
    message = changed(FIRST, f"{CAR}.curvature.value", raw)
    _, vehicle = of_version_1(message)["cam"]["camParameters"]["highFrequencyContainer"]
    assert vehicle["curvature"] == {"curvatureValue": fine, "curvatureConfidence": "unavailable"}
    again = sent(taken(message | {"protocol_version": 1}).pdu)["message"]
    assert again == message | {"protocol_version": 1}


@pytest.mark.parametrize(("fine", "raw"), [(386, 129), (30_000, 1022), (-30_000, -1023), (30_001, 1023)])
def test_the_curvature_of_a_cam_1_3_2_is_written_in_the_unit_of_the_schema(fine: int, raw: int):
    value = of_version_1(FIRST)
    value["cam"]["camParameters"]["highFrequencyContainer"][1]["curvature"]["curvatureValue"] = fine
    envelope = sent(captain_messages.find("cam-1.3.2").encode(value))
    VALIDATOR.validate(envelope)
    car = envelope["message"]["high_frequency_container"]["basic_vehicle_container_high_frequency"]
    assert car["curvature"]["value"] == raw


def test_the_lane_of_a_cam_1_3_2_is_refused_both_ways():
    message = changed(FIRST, f"{CAR}.lane_position", 1) | {"protocol_version": 1}
    with pytest.raises(
        RefusedError,
        match=r"lane_position: LanePosition of CAM V1\.3\.2 cannot be converted: it counts from the outermost lane",
    ):
        taken(message)
    value = of_version_1(FIRST)
    value["cam"]["camParameters"]["highFrequencyContainer"][1]["lanePosition"] = 1
    with pytest.raises(RequestError, match="it counts from the outermost lane, the schema from the innermost"):
        sent(captain_messages.find("cam-1.3.2").encode(value))


def test_without_a_format_it_is_this_one():
    payload = json.loads(
        json.dumps({"message_type": "cam", "source_uuid": "x", "timestamp": NOW_MS, "version": "2.2.0"})
    )
    found = station().receive(Delivery("in/cam", json.dumps({**payload, "message": FIRST}).encode()))
    assert found == ReceivedPdu(taken(FIRST).pdu, None, "x")


def test_the_pdu_in_base64_is_taken_beside_it():
    coded = {"version": "ETSI EN 302 637-2 v1.4.1", "payload": "AgIAAAU5AAECAw=="}
    assert taken(coded, message_format="asn1/uper").pdu == PDU


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("protocol_version", 9, "message.protocol_version: 9: no edition of cam has this protocolVersion"),
        ("protocol_version", ..., "message.protocol_version: is missing"),
        ("station_id", "42", "message.station_id: '42' is not an integer"),
        ("station_id", 1 << 32, "4294967296"),
        ("generation_delta_time", 65_536, "65536"),
        ("basic_container", ..., "basicContainer"),
        ("basic_container.station_type", True, "message.basic_container.station_type: true is not an integer"),
        ("basic_container.station_type", 5.0, "station_type: 5.0 is not an integer"),
        ("basic_container.station_tpe", 5, "station_tpe: is not known; known: station_type"),
        ("basic_container.reference_position.latitude", 900_000_002, "900000002"),
        (f"{CAR}.drive_direction", 3, "drive_direction: is not known; known: 0, 1, 2"),
        (f"{CAR}.acceleration_control", {"brake": True}, "acceleration_control.brake: is not known"),
        (f"{CAR}.acceleration_control", {"acc_engaged": 1}, "acceleration_control.acc_engaged: 1 is not true or false"),
        (HIGH, {}, "high_frequency_container: 0 members; the object of a CHOICE must have one"),
        (HIGH, {"bus": {}}, "high_frequency_container.bus: is not known"),
        ("low_frequency_container", [], "low_frequency_container: an array is not an object"),
        (
            "special_vehicle_container",
            {"emergency_container": {"incident_indication": {"cc_and_scc": {"subcause": 1}}}},
            "incident_indication.cc_and_scc.cause: null is not an integer",
        ),
    ],
)
def test_what_does_not_follow_the_schema_is_refused_with_its_path(path: str, value: Any, says: str):
    with pytest.raises(RefusedError, match=says) as refused:
        taken(changed(FIRST, path, value))
    assert refused.value.reason is Reason.PAYLOAD


def test_other_types_are_refused_by_the_name_of_the_format():
    envelope = {"message_type": "vam", "source_uuid": "x", "timestamp": NOW_MS, "version": "2.0.0", "message": {}}
    with pytest.raises(RefusedError, match="message_format: \"json/raw\" of 'vam' is not read"):
        station().receive(Delivery("in/vam", json.dumps(envelope).encode()))


def test_other_types_are_not_written():
    with pytest.raises(RequestError, match='vam: "json/raw" is written for cam, denm, cpm, spatem, mapem only'):
        station().publications("vam", 2018, PDU, HERE, NOW_MS)


def test_a_cam_that_cannot_be_decoded_is_not_written_and_it_says_why():
    with pytest.raises(RequestError, match='cam: cannot be written as "json/raw"'):
        station().publications("cam", 2001, bytes.fromhex("02020000000700"), HERE, NOW_MS)


STATION = station()


@given(st.data())
def test_a_mutated_cam_is_taken_or_explained(data: st.DataObject):
    payload = bytearray(json.dumps(sent(CAMS[0])).encode())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(payload) - 1))
        payload[at : at + data.draw(st.integers(0, 2))] = data.draw(
            st.binary(max_size=3) | st.sampled_from([b"9", b"-", b"e"])
        )
    try:
        assert STATION.receive(Delivery("in/cam", bytes(payload))).pdu
    except RefusedError as error:
        assert error.message
