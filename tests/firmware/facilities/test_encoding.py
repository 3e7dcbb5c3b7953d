"""Encoding of users' JSON: completion, faults, and input that is hostile."""

import json
from typing import Any

import captain_messages as messages
import pytest

from board.runtime.child import MAX_MESSAGE
from firmware.codec.library import load
from firmware.facilities.encoding import Encoder, FaultsError
from firmware.facilities.exchange import Ask, packed
from firmware.facilities.paths import type_at
from firmware.topics import JSON_FORMS

ENCODER = Encoder(load())
WITH_HEADER = [message for message in messages.all() if message.ids]
CONTAINER = "cam.camParameters.highFrequencyContainer.basicVehicleContainerHighFrequency"


def ask(value: object, form: str = "json", type_: str = "", message_id: int = -1) -> Ask:
    body = value if isinstance(value, bytes) else json.dumps(value).encode()
    return Ask(1, type_, message_id, form, body, 4711, 500_000_000_000, 487668000, 114321000)


def faults(value: object, form: str = "json", type_: str = "") -> dict[str, str]:
    """Return the problems of a message by path. Check that the answer of the process is bounded."""
    with pytest.raises(FaultsError) as caught:
        ENCODER.encode(ask(value, form, type_))
    assert len(packed("refused", 1, "bad-json", caught.value.message, caught.value.faults)) < MAX_MESSAGE
    return {path: problem for path, problem, _ in caught.value.faults}


def cam(**components: object) -> dict[str, Any]:
    container = {"basicVehicleContainerHighFrequency": {"driveDirection": "forward", **components}}
    parameters = {"basicContainer": {"stationType": 5}, "highFrequencyContainer": container}
    return {"edition": "cam-1.4.1", "message": {"cam": {"camParameters": parameters}}}


@pytest.mark.parametrize("form", JSON_FORMS)
@pytest.mark.parametrize("name", [message.name for message in WITH_HEADER])
def test_example_of_an_edition_without_its_header_is_encoded_with_that_of_the_station(name: str, form: str) -> None:
    message = messages.find(name)
    value = json.loads(message.to_json(message.encode(message.example()), plain=form == "plain"))
    del value["header"]
    octets, type_ = ENCODER.encode(ask({"edition": name, "message": value}, form))
    assert (octets[0] in message.versions, octets[1] in message.ids) == (True, True)
    assert int.from_bytes(octets[2:6], "big") == 4711
    assert type_ == message.type


@pytest.mark.parametrize("form", JSON_FORMS)
@pytest.mark.parametrize("name", [message.name for message in messages.all()])
def test_empty_message_of_an_edition_is_refused_or_encoded(name: str, form: str) -> None:
    try:
        ENCODER.encode(ask({"edition": name, "message": {}}, form))
    except FaultsError as error:
        assert all(problem.startswith("missing: ") or not path for path, problem, _ in error.faults), error.faults


@pytest.mark.parametrize("form", JSON_FORMS)
@pytest.mark.parametrize(
    "value",
    [
        None, [], "cam", 7, True, {}, {"message": None}, {"message": []}, {"message": {}}, {"edition": 7, "message": {}},
        {"edition": ["cam"], "message": {}}, {"edition": "cam-1.4.1", "form": [], "message": {}}, {"header": []},
        {"edition": "cam-1.4.1", "message": {"header": [], "cam": 1}}, {"edition": "cam-1.4.1", "message": {"header": {"messageID": -1}}},
        {"edition": "cam-1.4.1", "message": {"header": {"protocolVersion": 300}}},
        {"edition": "cam-1.4.1", "message": {"x": [0] * 20_000}}, {"edition": "cam-1.4.1", "message": {"x" * 50_000: 0}},
        {"edition": "cam-1.4.1", "message": {"cam": {f"x{number}": number for number in range(3_000)}}},
        {"edition": "cam-1.4.1", "message": {"a[0]": 1, "[x": 2, "[3]": 3, "a.b": 4, "": 5}},
        {"edition": "cam-1.4.1", "message": {"cam": {"camParameters": {"highFrequencyContainer": {"a": 1, "b": 2}}}}},
        {"edition": "rawtx-1", "message": {}},
    ],
    ids=lambda value: repr(value)[:60],
)  # fmt: skip
def test_hostile_json_is_refused_with_faults(value: object, form: str) -> None:
    assert faults(value, form)


@pytest.mark.parametrize("depth", [100, 500, 900, 978, 979, 980, 981, 5_000])
def test_deep_json_is_refused_at_any_depth(depth: int) -> None:
    body = b'{"edition":"cam-1.4.1","message":{"x":' + b"[" * depth + b"]" * depth + b"}}"
    assert faults(body)


def test_faults_behind_one_of_a_list_of_bits_are_listed_as_well() -> None:
    value = cam(accelerationControl=7, speed="x", vehicleWidth=True, vehicleLength={"vehicleLengthValue": 0})
    assert set(faults(value)) == {
        f"{CONTAINER}.accelerationControl",
        f"{CONTAINER}.speed",
        f"{CONTAINER}.vehicleWidth",
        f"{CONTAINER}.vehicleLength.vehicleLengthValue",
    }


def test_unknown_edition_is_refused_with_the_editions_of_its_type() -> None:
    known = "cam-1.4.1, cam-2.3.1, cam-2.1.1, cam-1.3.2, cam-2.3.1-ext"
    assert faults({"edition": "cam-9", "message": {}}) == {"edition": f"unknown edition; known: {known}"}
    assert faults({"edition": "cam-1.4.2", "message": {}}) == {"edition": "unknown edition; did you mean cam-1.4.1?"}


def test_header_of_another_message_is_refused() -> None:
    value = cam()
    value["message"]["header"] = {"protocolVersion": 2, "messageID": 1, "stationID": 7}
    assert set(faults(value)) == {"header"}


def test_message_of_several_ids_gets_the_one_of_its_envelope() -> None:
    message = messages.find("vam-1")
    value = json.loads(message.to_json(message.encode(message.example())))
    del value["header"]
    one = {"edition": "vam-1", "message": value}
    assert ENCODER.encode(ask(one)).octets[1] == 16
    assert ENCODER.encode(ask(one, "json", "vam", 102)).octets[1] == 102


def test_position_of_an_event_is_not_that_of_the_station() -> None:
    management = {"actionID": {"sequenceNumber": 1}, "stationType": 5}
    value = {"edition": "denm-1.3.1", "message": {"denm": {"management": management}}}
    position = "denm.management.eventPosition"
    assert set(faults(value)) == {f"{position}.latitude", f"{position}.longitude"}


def test_position_with_a_latitude_alone_is_refused() -> None:
    value = cam()
    value["message"]["cam"]["camParameters"]["basicContainer"]["referencePosition"] = {"latitude": 487668000}
    assert set(faults(value)) == {"cam.camParameters.basicContainer.referencePosition.longitude"}


def test_object_of_captain_decode_is_encoded_to_the_same_octets() -> None:
    octets = bytes.fromhex(
        "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
    )
    message = json.loads(messages.find("cam-1.4.1").to_json(octets))
    told = {
        "edition": "cam-1.4.1",
        "type": "cam",
        "why": "w",
        "candidates": [],
        "origin": "x",
        "octets": 46,
        "message": message,
    }
    assert ENCODER.encode(ask(told)) == (octets, "cam")


def encode_fields(fields: object, edition: str = "cam-1.4.1", **changes: object) -> dict[str, Any]:
    octets, _ = ENCODER.encode(ask({"edition": edition, "fields": fields})._replace(**changes))
    return json.loads(messages.find(edition).to_json(octets, plain=True))


def test_fields_of_a_cam_are_encoded_with_own_id_time_and_position() -> None:
    sent = encode_fields({"speed": 13.9, "heading": 90.0})
    basic = sent["cam"]["camParameters"]["basicContainer"]
    assert sent["header"]["stationID"] == 4711
    assert sent["cam"]["generationDeltaTime"] == 500_000_000_000 % 65_536 / 1000
    assert basic["referencePosition"]["latitude"] == 48.7668
    high = sent["cam"]["camParameters"]["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]
    assert (high["speed"]["speedValue"], high["heading"]["headingValue"]) == (13.9, 90.0)


def test_fields_that_the_station_knows_are_those_of_the_user_if_given() -> None:
    given = {"station": 7, "time": 1.5, "latitude": 48.7, "longitude": 11.4}
    sent = encode_fields(given, latitude=None, longitude=None, its_ms=0)
    position = sent["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    assert (sent["header"]["stationID"], sent["cam"]["generationDeltaTime"]) == (7, 1.5)
    assert (position["latitude"], position["longitude"]) == (48.7, 11.4)


def test_fields_by_path_are_encoded() -> None:
    sent = encode_fields({f"{CONTAINER}.speed.speedValue": 13.9, f"{CONTAINER}.speed.speedConfidence": 1.0})
    high = sent["cam"]["camParameters"]["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]
    assert high["speed"] == {"speedValue": 13.9, "speedConfidence": 1.0}


def test_all_faults_of_fields_are_listed_at_once() -> None:
    found = faults({"edition": "cam-1.4.1", "fields": {"speed": 999, "sped": 1, "heading": [1], "length": 4.5}})
    assert set(found) == {f"{CONTAINER}.speed.speedValue", "sped", f"{CONTAINER}.heading.headingValue"}
    assert "speed" in found["sped"]


def test_field_that_is_spelt_as_in_another_edition_is_kept() -> None:
    assert encode_fields({"header.stationId": 77})["header"]["stationID"] == 77


def test_altitude_alone_is_sent_with_the_own_place() -> None:
    place = encode_fields({"altitude": 300})["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    assert (place["latitude"], place["altitude"]["altitudeValue"]) == (48.7668, 300)


def test_faults_of_unknown_paths_and_names_are_listed_beside_others() -> None:
    assert set(faults({"edition": "cam-1.4.1", "fields": {"a.b": 1, "speed": -1, "hea": 3}})) == {
        "a.b", f"{CONTAINER}.speed.speedValue", "hea",
    }  # fmt: skip


RSU = "cam.camParameters.highFrequencyContainer.rsuContainerHighFrequency.protectedCommunicationZonesRSU[0]"


@pytest.mark.parametrize(
    ("fields", "path", "problem"),
    [
        ({"speed": 5, f"{CONTAINER}.speed.speedValue": 6}, f"{CONTAINER}.speed.speedValue", "given twice"),
        ({"speed": 5, f"{RSU}.protectedZoneLatitude": 3}, f"{CONTAINER}.speed.speedValue", "another field excludes it"),
        ({f"{RSU}.protectedZoneLatitude": 3, "speed": 5}, f"{RSU}.protectedZoneLatitude", "another field excludes it"),
    ],
)
def test_fields_that_contradict_each_other_are_refused(fields: dict[str, object], path: str, problem: str) -> None:
    assert problem in faults({"edition": "cam-1.4.1", "fields": fields})[path]


@pytest.mark.parametrize("form", ["json", "plain", "xml", 7])
def test_form_beside_fields_is_refused(form: object) -> None:
    assert "form" in faults({"edition": "cam-1.4.1", "form": form, "fields": {"speed": 14}})


@pytest.mark.parametrize("name", [message.name for message in WITH_HEADER])
def test_each_short_name_of_an_edition_is_kept(name: str) -> None:
    message = messages.find(name)
    for short, path in message.short_names.items():
        for value in (
            1,
            1.0,
            "forward",
            "default",
            "isCancellation",
            "00",
            *(one for one, _ in type_of(message, path).names),
        ):
            try:
                message.example(**{short: value})
            except ValueError:
                continue
            fields = {
                short: value,
                **{place: 1.0 for place in ("latitude", "longitude") if place in message.short_names},
            }
            ENCODER.encode(ask({"edition": name, "fields": fields}))
            break


def type_of(message: messages.Message, path: str) -> Any:
    return type_at(message.type_tree(), path) or message.type_tree()


def test_fields_of_a_denm_without_the_place_of_the_event_are_refused() -> None:
    found = faults({"edition": "denm-1.3.1", "fields": {"cause": 94}})
    place = "denm.management.eventPosition"
    assert set(found) == {f"{place}.latitude", f"{place}.longitude"}


@pytest.mark.parametrize(
    "body",
    [
        {"fields": []}, {"fields": {"": 1}}, {"fields": {"speed": None}}, {"fields": {"speed": {}}}, {"fields": {"speed": True}},
        {"fields": {"speed": 1.0}, "message": {}}, {"fields": {"cam": 1}}, {"fields": {"a" * 50_000: 1}}, {"fields": {"speed": "9" * 50_000}},
        {"fields": {f"a{number}": number for number in range(3_000)}}, {"fields": {"speed": 10**400}}, {"edition": [], "fields": {}},
    ],
    ids=lambda body: repr(body)[:60],
)  # fmt: skip
def test_hostile_fields_are_refused_with_faults(body: dict[str, object]) -> None:
    assert faults({"edition": "cam-1.4.1", **body})


@pytest.mark.parametrize("name", [message.name for message in WITH_HEADER])
def test_fields_of_every_edition_with_its_place_make_a_legal_message(name: str) -> None:
    message = messages.find(name)
    place = {field: 1.0 for field in ("latitude", "longitude") if field in message.short_names}
    octets, _ = ENCODER.encode(ask({"edition": name, "fields": place}))
    assert int.from_bytes(octets[2:6], "big") == 4711
