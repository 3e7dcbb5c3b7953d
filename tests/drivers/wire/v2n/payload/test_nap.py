"""Vanetza-NAP's JSON, through the message library: members and headers, both ways."""

import copy
import json
from typing import Any

import captain_messages
import pytest

from board.runtime.errors import RequestError
from drivers.reason import Reason
from drivers.wire.v2n.description import ProfileDescription, PublishRow, SubscribeRow
from drivers.wire.v2n.message import Sending
from drivers.wire.v2n.payload.nap import NapReceived, NapToSend
from drivers.wire.v2n.profile import Delivery, RefusedError
from tests.drivers.wire.v2n.payload.nap import CAM, CPM, DENM, LIBRARY, OLD_CAM, VECTORS, sent, station
from tests.drivers.wire.v2n.station import HERE, NOW_MS, delivered, profile


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
    assert envelope["fields"]["header"] == {"protocolVersion": 2, "messageId": 2, "stationId": envelope["stationID"]}


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


def test_a_container_of_a_cpm_is_read_with_the_name_of_its_type_and_without():
    pdu = sent("cpm", CPM)
    named = copy.deepcopy(CPM)
    (container,) = named["cpmContainers"]
    container["containerData"] = {"OriginatingVehicleContainer": container["containerData"]}  # type: ignore[index]
    assert sent("cpm", named) == pdu
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
    # A CPM of release 2 has protocolVersion 2 and messageID 14; the CPM of the technical report has protocolVersion 1.
    (pdu,) = [pdu for kind, pdu in VECTORS if kind == "cpm"][:1]
    body = NapToSend(1, LIBRARY).write(Sending("cpm", 1, pdu, HERE, NOW_MS))
    assert station().receive(Delivery("vanetza/in/cpm", body)).pdu[0] == 1


# CAM V1.3.2 of a made value, curvature 386; V1.4.1 reads -74.
VERSION_1 = bytes.fromhex("010200000001c41e005a97ac450dd00a399ffffffc23b7743e00d2afc14dfe3fe9ed0733b590303600")


def test_a_cam_of_protocol_version_1_is_shown_as_cam_1_3_2_and_comes_back():
    payload = station().publications("cam", 2001, VERSION_1, HERE, NOW_MS)[0].payload
    fields = json.loads(payload)["fields"]
    assert fields["header"]["protocolVersion"] == 1
    vehicle = fields["cam"]["camParameters"]["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]
    assert vehicle["curvature"] == {"curvatureValue": 386, "curvatureConfidence": 0}
    assert NapReceived(8, LIBRARY).read("cam", payload) == (VERSION_1, "")


@pytest.mark.parametrize("curvature", [-30_000, -1024, 1023, 1024, 5000, 30_000, 30_001])
@pytest.mark.parametrize("way", [NapReceived, NapToSend])
def test_a_cam_of_protocol_version_1_comes_back_with_curvature_beyond_the_range_of_cam_1_4_1(way: Any, curvature: int):
    message = captain_messages.find("cam-1.3.2")
    value: Any = message.decode(VERSION_1)
    _, vehicle = value["cam"]["camParameters"]["highFrequencyContainer"]
    vehicle["curvature"]["curvatureValue"] = curvature
    pdu = message.encode(value)
    written = json.loads(NapReceived(1, LIBRARY).write(Sending("cam", 1, pdu, HERE, NOW_MS)))
    payload = written if way is NapReceived else written["fields"]
    assert way(8, LIBRARY).read("cam", json.dumps(payload).encode()) == (pdu, "")


def test_a_denm_of_protocol_version_1_comes_back_with_a_phone_number_that_denm_1_3_1_has_not():
    message = captain_messages.find("denm-1.2.2")
    pdu = b"\1" + [pdu for kind, pdu in VECTORS if kind == "denm"][1][1:]
    value: Any = message.decode(pdu)
    goods = dict.fromkeys(("elevatedTemperature", "tunnelsRestricted", "limitedQuantity"), False)
    goods |= {"dangerousGoodsType": "explosives1", "unNumber": 0, "phoneNumber": "+43"}  # digits alone in V1.3.1
    value["denm"]["alacarte"] = {"stationaryVehicle": {"carryingDangerousGoods": goods}}
    pdu = message.encode(value)
    payload = NapReceived(1, LIBRARY).write(Sending("denm", 1, pdu, HERE, NOW_MS))
    assert NapReceived(8, LIBRARY).read("denm", payload) == (pdu, "")


@pytest.mark.parametrize("header", [{}, {"protocolVersion": "1"}, {"protocolVersion": 256, "messageID": 2}, 5, None])
def test_a_header_that_is_none_is_refused(header: object):
    with pytest.raises(RefusedError):
        sent("cam", {"header": header, "cam": OLD_CAM})


def test_a_cpm_whose_form_is_not_encoded_is_written_without_its_header():
    message = captain_messages.find("cpm-2.1.1-ext")
    pdu = message.encode(captain_messages.find("cpm-2.1.1").decode(sent("cpm", CPM)))
    pdu = bytes((2, 14)) + pdu[2:]
    assert json.loads(NapToSend(1, LIBRARY).write(Sending("cpm", 1, pdu, HERE, NOW_MS)))["cpmContainers"]


def test_a_cam_1_3_2_is_not_written_without_its_header():
    with pytest.raises(
        RequestError, match=r"cannot send cam-1\.3\.2 without its header: receivers would decode it as cam-1\.4\.1"
    ):
        NapToSend(1, LIBRARY).write(Sending("cam", 1, VERSION_1, HERE, NOW_MS))


def test_the_header_of_the_json_selects_the_edition():
    header = {"protocolVersion": 1, "messageID": 2, "stationID": 4711}
    pdu = sent("cam", {"header": header, "cam": OLD_CAM})
    value: Any = captain_messages.find("cam-1.3.2").decode(pdu)
    assert value["header"]["protocolVersion"] == 1
    _, vehicle = value["cam"]["camParameters"]["highFrequencyContainer"]
    assert vehicle["curvature"]["curvatureValue"] == 1023


def test_a_body_without_a_header_is_not_sent_as_an_older_edition_for_a_value_out_of_range():
    body = copy.deepcopy(OLD_CAM)
    vehicle = body["camParameters"]["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]
    vehicle["curvature"]["curvatureValue"] = 5000
    with pytest.raises(RefusedError, match=r"cam-1\.4\.1: .*curvatureValue: out of range: 5000"):
        sent("cam", body)


def test_a_message_that_two_editions_read_with_different_values_is_not_written():
    vam = bytes.fromhex("031000001267ce004137480ef6c6b49d2000004dd1c2148d5b0006ea6afffb98031010")
    for payload in (NapReceived(8, LIBRARY), NapToSend(8, LIBRARY)):
        with pytest.raises(
            RequestError, match=r"ambiguous edition: vam-2\.3\.1 and vam-2\.1\.1 decode it to different values"
        ):
            payload.write(Sending("vam", 2018, vam, HERE, NOW_MS))


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
