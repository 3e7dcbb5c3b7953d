"""Vanetza-NAP's JSON, through the message library: members, units, and what cannot be said in it."""

import copy
import json
from pathlib import Path
from typing import Any

import captain_messages
import pytest
from hypothesis import given
from hypothesis import strategies as st

import firmware
from board.errors import ConfigurationError, RequestError
from drivers.mqtt_profile import MessageLibrary, load
from drivers.reason import Reason
from drivers.wire.v2n import Delivery, Identity, Profile, RefusedError
from drivers.wire.v2n_description import ProfileDescription, PublishRow, SubscribeRow
from drivers.wire.v2n_message import Sending
from drivers.wire.v2n_payload_nap import NapReceived, NapToSend
from drivers.wire.v2n_payload_si import ConversionError, to_json
from drivers.wire.v2n_payload_si_read import from_json
from drivers.wire.v2n_payload_units import UNITS
from tests.drivers.wire.v2n_station import HERE, NOW_MS, delivered, profile

LIBRARY = MessageLibrary(captain_messages.all())
VECTORS = [
    (vector["type"].lower(), bytes.fromhex(vector["hex"]))
    for vector in json.loads((Path(firmware.__file__).parent / "vectors.json").read_text())
]

# Members as in examples/in_cam.json of nap-it/vanetza-nap (release 2), with values of our own.
CAM = {
    "generationDeltaTime": 4711,
    "camParameters": {
        "basicContainer": {
            "stationType": 5,
            "referencePosition": {
                "latitude": 47.0707,
                "longitude": 15.4395,
                "positionConfidenceEllipse": {
                    "semiMajorAxisLength": 1.5,
                    "semiMinorAxisLength": 4095,
                    "semiMajorAxisOrientation": 3601,
                },
                "altitude": {"altitudeValue": 353.2, "altitudeConfidence": 15},
            },
        },
        "highFrequencyContainer": {
            "basicVehicleContainerHighFrequency": {
                "heading": {"headingValue": 92.3, "headingConfidence": 127},
                "speed": {"speedValue": 13.89, "speedConfidence": 0.5},
                "driveDirection": 0,
                "vehicleLength": {"vehicleLengthValue": 4.2, "vehicleLengthConfidenceIndication": 4},
                "vehicleWidth": 1.8,
                "longitudinalAcceleration": {"value": -0.4, "confidence": 102},
                "curvature": {"curvatureValue": 1023, "curvatureConfidence": 7},
                "curvatureCalculationMode": 2,
                "yawRate": {"yawRateValue": -1.25, "yawRateConfidence": 8},
                "accelerationControl": {"brakePedalEngaged": True, "accEngaged": False},
            }
        },
    },
}
# As in examples/in_cam_full.json: release 1.
OLD_CAM = copy.deepcopy(CAM)
OLD_CAM["camParameters"]["basicContainer"]["referencePosition"]["positionConfidenceEllipse"] = {
    "semiMajorConfidence": 1.5,
    "semiMinorConfidence": 4095,
    "semiMajorOrientation": 3601,
}
OLD_CAM["camParameters"]["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]["longitudinalAcceleration"] = {
    "longitudinalAccelerationValue": -0.4,
    "longitudinalAccelerationConfidence": 102,
}
# As in examples/in_denm.json.
DENM = {
    "management": {
        "actionId": {"originatingStationId": 4711, "sequenceNumber": 3},
        "detectionTime": 700_000_000.25,
        "referenceTime": 700_000_001,
        "eventPosition": {
            "latitude": 47.0707,
            "longitude": 15.4395,
            "positionConfidenceEllipse": {
                "semiMajorConfidence": 0.4,
                "semiMinorConfidence": 0.3,
                "semiMajorOrientation": 135.5,
            },
            "altitude": {"altitudeValue": 0, "altitudeConfidence": 1},
        },
        "validityDuration": 60,
        "stationType": 5,
    },
    "situation": {"informationQuality": 7, "eventType": {"ccAndScc": {"wrongWayDriving14": 0}}},
    # Members added in release 2 are in an object of their own, as in examples/out_denm.json.
    "location": {
        "eventPositionHeading": {"value": 2700, "confidence": 8},
        "detectionZonesToEventPosition": [
            [{"pathPosition": {"deltaLatitude": 0.0002, "deltaLongitude": 0.0004, "deltaAltitude": 1}}]
        ],
        "ext1": {"linkedMapems": [{"roadsegment": {"region": 15, "id": 8}}]},
    },
}
# As in examples/out_cpm.json: what a container holds stands below the name of its type.
CPM = {
    "managementContainer": {
        "referenceTime": 700_000_000,
        "referencePosition": DENM["management"]["eventPosition"],  # type: ignore[index]
    },
    "cpmContainers": [
        {
            "containerId": 1,
            "containerData": {"OriginatingVehicleContainer": {"orientationAngle": {"value": 900, "confidence": 1}}},
        }
    ],
}  # fmt: skip


def station(number: int = 7) -> Profile:
    return profile("nap", station=number)


def sent(kind: str, body: dict[str, Any]) -> bytes:
    return station().receive(Delivery(f"vanetza/in/{kind}", json.dumps(body).encode())).pdu


@pytest.mark.parametrize(("kind", "pdu"), VECTORS, ids=lambda value: value if isinstance(value, str) else "")
def test_messages_of_other_implementations_come_back_from_the_json(kind: str, pdu: bytes):
    found = station().publications(kind, 2001, pdu, HERE, NOW_MS)
    by_topic = {one.topic: one.payload for one in found}
    own = {"vanetza/own/cam"} if kind == "cam" else set()
    assert set(by_topic) == {f"vanetza/out/{kind}", f"vanetza/out/{kind}_enc", *own}
    assert by_topic[f"vanetza/out/{kind}_enc"] == pdu
    assert NapReceived(8, LIBRARY).read(kind, by_topic[f"vanetza/out/{kind}"]) == (pdu, "")


@pytest.mark.parametrize(("kind", "pdu"), VECTORS, ids=lambda value: value if isinstance(value, str) else "")
def test_a_message_without_its_header_gets_one_of_this_station(kind: str, pdu: bytes):
    body = NapToSend(1, LIBRARY).write(Sending(kind, 1, pdu, HERE, NOW_MS))
    assert "header" not in json.loads(body)
    back = station(0x01020304).receive(Delivery(f"vanetza/in/{kind}", body)).pdu
    assert back[1:6] == bytes((pdu[1], 1, 2, 3, 4))
    assert back[6:] == pdu[6:]


def test_the_envelope_has_the_members_of_the_examples():
    (kind, pdu) = VECTORS[1]
    envelope = json.loads(station().publications(kind, 2001, pdu, HERE, NOW_MS)[0].payload)
    assert set(envelope) == {
        "timestamp", "rssi", "stationID", "stationAddr", "receiverID", "receiverType", "packet_size", "fields",
    }  # fmt: skip
    assert envelope["timestamp"] == NOW_MS / 1000
    assert envelope["stationID"] == int.from_bytes(pdu[2:6], "big")
    assert envelope["receiverID"] == 7
    assert envelope["packet_size"] == len(pdu)
    assert list(envelope["fields"]) == ["header", "cam"]
    assert envelope["fields"]["header"] == {"protocolVersion": 2, "messageID": 2, "stationID": envelope["stationID"]}


def test_a_cam_of_release_2_as_applications_write_it():
    pdu = sent("cam", CAM)
    value: Any = captain_messages.find("cam-2.1.1").decode(pdu)
    assert value["header"] == {"protocolVersion": 2, "messageId": 2, "stationId": 7}
    basic = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    assert (basic["latitude"], basic["longitude"]) == (470_707_000, 154_395_000)
    assert basic["positionConfidenceEllipse"] == {
        "semiMajorAxisLength": 150,
        "semiMinorAxisLength": 4095,
        "semiMajorAxisOrientation": 3601,
    }
    assert basic["altitude"]["altitudeValue"] == 35_320
    name, vehicle = value["cam"]["camParameters"]["highFrequencyContainer"]
    assert name == "basicVehicleContainerHighFrequency"
    assert vehicle["heading"] == {"headingValue": 923, "headingConfidence": 127}
    assert vehicle["speed"] == {"speedValue": 1389, "speedConfidence": 50}
    assert vehicle["driveDirection"] == "forward"
    assert (vehicle["vehicleLength"]["vehicleLengthValue"], vehicle["vehicleWidth"]) == (42, 18)
    assert vehicle["longitudinalAcceleration"] == {"value": -4, "confidence": 102}
    assert vehicle["yawRate"]["yawRateValue"] == -125
    assert vehicle["accelerationControl"] == (b"\x80", 7)


def test_a_cam_of_release_1_is_one_too():
    value: Any = captain_messages.find("cam-1.4.1").decode(sent("cam", OLD_CAM))
    ellipse = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]["positionConfidenceEllipse"]
    assert ellipse["semiMajorConfidence"] == 150


def test_a_denm_with_members_of_release_2():
    value: Any = captain_messages.find("denm-2.2.1").decode(sent("denm", DENM))
    management = value["denm"]["management"]
    assert management["detectionTime"] == 700_000_000_250
    assert management["eventPosition"]["positionConfidenceEllipse"]["semiMajorOrientation"] == 1355
    assert value["denm"]["situation"]["eventType"]["ccAndScc"] == ("wrongWayDriving14", 0)
    location = value["denm"]["location"]
    assert location["eventPositionHeading"]["value"] == 2700  # no unit of its own there
    assert location["linkedMapems"][0] == ("roadsegment", {"region": 15, "id": 8})
    back = json.loads(NapToSend(7, LIBRARY).write(Sending("denm", 1, sent("denm", DENM), HERE, NOW_MS)))
    assert back["location"]["ext1"] == {"linkedMapems": [{"roadsegment": {"region": 15, "id": 8}}]}


def test_a_container_of_a_cpm_is_named_by_its_type():
    pdu = sent("cpm", CPM)
    value: Any = captain_messages.find("cpm-2.1.1").decode(pdu)
    assert value["payload"]["cpmContainers"][0]["containerId"] == 1
    back = json.loads(NapToSend(7, LIBRARY).write(Sending("cpm", 1, pdu, HERE, NOW_MS)))
    assert back["cpmContainers"] == CPM["cpmContainers"]


def test_a_header_that_is_given_is_taken():
    header = {"protocolVersion": 2, "messageId": 2, "stationId": 4711}
    assert sent("cam", {"header": header, "cam": CAM})[2:6] == (4711).to_bytes(4, "big")


@pytest.mark.parametrize("name", ["stationID", "stationId"])
def test_a_station_id_beside_the_body_goes_into_the_header(name: str):
    assert sent("cam", {name: 4711, **CAM})[2:6] == (4711).to_bytes(4, "big")


def test_a_version_that_receivers_take_for_another_edition_is_avoided():
    # protocolVersion 2 with messageID 14 is the CPM of release 2: that of the technical report has 1.
    (pdu,) = [pdu for kind, pdu in VECTORS if kind == "cpm"][:1]
    body = NapToSend(1, LIBRARY).write(Sending("cpm", 1, pdu, HERE, NOW_MS))
    assert station().receive(Delivery("vanetza/in/cpm", body)).pdu[0] == 1


def test_a_type_can_be_named_by_its_message_id():
    assert sent("2", CAM)[:6] == bytes.fromhex("020200000007")


def test_the_pdu_as_it_is_is_taken_too():
    kind, pdu = VECTORS[1]
    assert station().receive(Delivery(f"vanetza/in/{kind}_enc", pdu)).pdu == pdu


def test_what_this_station_said_that_it_received_is_an_echo():
    with pytest.raises(RefusedError) as refused:
        NapReceived(7, LIBRARY).read("cam", station().publications("cam", 1, VECTORS[1][1], HERE, NOW_MS)[0].payload)
    assert refused.value.reason is Reason.OWN_ECHO


def test_two_stations_can_talk_in_either_form():
    for form in ("nap", "nap-body"):
        description = ProfileDescription(
            "both", (PublishRow("v/{type}", form),), (SubscribeRow("v/{type}", form),)  # type: ignore[arg-type]
        )  # fmt: skip
        one, other = (
            profile(description, station=1),
            profile(description, station=int.from_bytes(VECTORS[1][1][2:6], "big")),
        )
        (found,) = one.publications("cam", 1, VECTORS[1][1], HERE, NOW_MS)
        assert other.receive(delivered(found)).pdu == VECTORS[1][1]


def changed(path: str, value: Any) -> dict[str, Any]:
    body = copy.deepcopy(CAM)
    *way, last = path.split(".")
    holder: Any = body
    for step in way:
        holder = holder[step]
    if value is ...:
        del holder[last]
    else:
        holder[last] = value
    return body


BASIC = "camParameters.basicContainer"
HIGH = "camParameters.highFrequencyContainer"
VEHICLE = f"{HIGH}.basicVehicleContainerHighFrequency"


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (f"{BASIC}.referencePosition.latitude", 91, "latitude.*910000000"),
        (f"{BASIC}.referencePosition.latitude", "47", "latitude: '47' is not a number"),
        (f"{BASIC}.referencePosition.latitude", True, "latitude: true is not a number"),
        (f"{BASIC}.referencePosition.latitude", None, "latitude: null is not a number"),
        (f"{BASIC}.referencePosition.latitude", 1e308, "latitude: 1e.308 is out of range"),
        (f"{BASIC}.referencePosition.latitude", 10**100, "latitude: 1000.* is out of range"),
        (f"{BASIC}.referencePosition.latitude", ..., "latitude"),
        (f"{BASIC}.referencePosition.latitud", 1, "latitud: is no member; known: latitude"),
        (f"{BASIC}.stationType", 5.5, "stationType: 5.5 is not an integer"),
        (f"{BASIC}.stationType", 256, "stationType.*256"),
        (f"{BASIC}.stationType", -1, "stationType.*-1"),
        (f"{BASIC}.referencePosition", [], "referencePosition: an array is not an object"),
        (f"{VEHICLE}.driveDirection", 3, "driveDirection: 3 is none of 0 forward, 1 backward, 2 unavailable"),
        (f"{VEHICLE}.driveDirection", "forward", "driveDirection: 'forward' is not a number"),
        (f"{VEHICLE}.accelerationControl", {"brake": True}, "accelerationControl.brake: is no bit; known: brakePedal"),
        (f"{VEHICLE}.accelerationControl", {"accEngaged": 1}, "accelerationControl.accEngaged: 1 is not true or false"),
        (f"{VEHICLE}.accelerationControl", "80", "accelerationControl: '80' is not an object"),
        (HIGH, {}, "highFrequencyContainer: 0 members; a CHOICE has one of"),
        (HIGH, {"a": 1, "b": 2}, "highFrequencyContainer: 2 members"),
        (HIGH, {"bus": {}}, "highFrequencyContainer.bus: is no alternative; known: basicVehicle"),
        ("header", {"stationId": 1}, "header"),
        ("stationId", "me", "stationI.: 'me' is not a number"),
    ],
)
def test_what_cannot_be_a_message_is_refused_with_its_path(path: str, value: Any, says: str):
    with pytest.raises(RefusedError, match=says) as refused:
        sent("cam", changed(path, value))
    assert refused.value.reason is Reason.PAYLOAD


def test_a_long_list_of_what_is_known_is_cut():
    cause = {"informationQuality": 7, "eventType": {"ccAndScc": {"nonsense": 0}}}
    with pytest.raises(RefusedError, match="nonsense: is no alternative") as refused:
        sent("denm", {**DENM, "situation": cause})
    assert len(refused.value.message) == 300


def test_an_unknown_type_is_refused_by_name():
    with pytest.raises(RefusedError, match="'nonsense' is no type that the message library has"):
        sent("nonsense", CAM)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"containerId": 99}, "what 99 stands for is not known"),
        ({"containerData": {"Other": {}}}, "has to have one member, OriginatingVehicleContainer"),
        ({"containerData": {}}, "has to have one member"),
    ],
)
def test_a_container_that_is_not_known_is_refused_with_its_path(change: dict[str, Any], says: str):
    body = copy.deepcopy(CPM)
    body["cpmContainers"][0] |= change  # type: ignore[operator, index]
    tree: Any = captain_messages.find("cpm-2.1.1").type_tree()
    with pytest.raises(ConversionError, match=says) as refused:
        from_json(tree.fields[1].type, body, "cpm")
    assert refused.value.path == "cpm.cpmContainers[0].containerData"


@pytest.mark.parametrize("pdu", [bytes.fromhex("02020000000700"), bytes.fromhex("02ee00000007000000")])
def test_a_message_that_cannot_be_decoded_is_not_published_and_it_says_why(pdu: bytes):
    with pytest.raises(RequestError, match="cam is not to be had as JSON"):
        station().publications("cam", 2001, pdu, HERE, NOW_MS)


def test_what_no_edition_knows_is_not_published_and_it_says_where():
    tree: Any = captain_messages.find("cam-1.4.1").type_tree()
    value: Any = captain_messages.find("cam-1.4.1").decode(VECTORS[1][1])
    value["cam"]["camParameters"]["[0]"] = b"\x00"
    with pytest.raises(ConversionError, match=r"cam\.cam\.camParameters\.\[0\]: no edition knows it"):
        to_json(tree, value, "cam")


def test_the_profile_needs_the_library_and_says_so():
    with pytest.raises(ConfigurationError, match="needs the message library"):
        Profile(load("nap"), Identity("vm", 1, "u", ""), None)


@pytest.mark.parametrize(("name", "scale", "themselves"), [(name, *row) for name, row in UNITS.items()])
def test_every_unit_is_of_a_type_and_turns_both_ways(name: str, scale: float, themselves: frozenset[int]):
    kind = Integer(name)
    for raw in (-1000, -1, 0, 1, 7, 1021, 470_707_123, *themselves):
        there = to_json(kind, raw, name)
        assert from_json(kind, there, name) == raw
        assert there == (raw if raw in themselves else pytest.approx(raw / scale))


class Integer:
    """An INTEGER with a name."""

    kind, low, high, names, fields, element, rows = "INTEGER", None, None, (), (), None, ()

    def __init__(self, name: str) -> None:
        self.name = name


def test_the_units_are_of_types_that_messages_have():
    # These are of messages that NAP has and the library has not, or of none.
    foreign = {"SensorHeight", "SpeedValueExtended", "CartesianCoordinateLarge", "StandardLength12b", "Radius"}
    found: set[str] = set()
    for message in captain_messages.all():
        collect(message.type_tree(), found, 0)
    assert set(UNITS) - found <= foreign


def collect(kind: Any, found: set[str], depth: int) -> None:
    if depth < 12:
        found.add(kind.name or "")
        below = [*(field.type for field in kind.fields), *(row for _, row in kind.rows)]
        for one in [*below, *([kind.element] if kind.element else [])]:
            collect(one, found, depth + 1)


NAP = station()


@given(st.data())
def test_a_mutated_body_is_taken_or_explained(data: st.DataObject):
    kind, body = data.draw(st.sampled_from([("cam", CAM), ("denm", DENM), ("cpm", CPM)]))
    payload = bytearray(json.dumps(body).encode())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(payload) - 1))
        payload[at : at + data.draw(st.integers(0, 2))] = data.draw(
            st.binary(max_size=3) | st.sampled_from([b"9", b"-", b"e"])
        )
    taken_or_explained(kind, bytes(payload))


@given(st.data())
def test_a_body_with_any_value_in_it_is_taken_or_explained(data: st.DataObject):
    body = copy.deepcopy(CAM)
    holder: Any = body
    while True:
        name = data.draw(st.sampled_from(sorted(holder)))
        if not isinstance(holder[name], dict) or data.draw(st.booleans()):
            break
        holder = holder[name]
    holder[name] = data.draw(ANYTHING)
    taken_or_explained("cam", json.dumps(body).encode())


ANYTHING = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    | st.lists(st.integers(), max_size=3) | st.dictionaries(st.text(max_size=5), st.integers(), max_size=3)
)  # fmt: skip


def taken_or_explained(kind: str, payload: bytes) -> None:
    try:
        found = NAP.receive(Delivery(f"vanetza/in/{kind}", payload))
    except RefusedError as error:
        assert error.message
    else:
        assert any(LIBRARY.decodings(found.pdu))
