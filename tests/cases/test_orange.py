"""JSON of Orange's its-client, in and out: every schema of its, and every message of ours against the one that it names."""

import json
from typing import Any

import captain_messages
import pytest
from jsonschema import Draft202012Validator, ValidationError

from board.runtime.errors import RequestError
from drivers.mqtt.profile import load
from drivers.reason import Reason
from drivers.wire.v2n.payload.orange.names import RAW
from drivers.wire.v2n.payload.si import ConversionError
from drivers.wire.v2n.profile import Delivery, Identity, Profile, RefusedError
from tests.cases import orange, orange_values
from tests.drivers.wire.v2n.station import (
    HERE,
    NOW_MS,
    PDU,
    SENDABLE,
    VECTORS,
    WITHOUT_FORM,
    WITHOUT_JSON,
    in_envelope,
    profile,
)

OURS, THEIRS = profile("orange"), profile("orange", uuid="ora_car_1")
SAMPLES = 12
# Read as JSON by some version; all others are refused by their format, or version.
READ = [
    name
    for name in orange.files()
    if name.split("_")[0] in RAW and not name.startswith(("cpm_schema_1", "cpm_schema_2-0"))
]
TOPICS = {"poi": "poim"}
WITH_SCHEMA = {name.split("_", maxsplit=1)[0] for name in orange.files()}


def sent(kind: str, pdu: bytes, station: Profile = OURS) -> dict[str, Any]:
    """The envelope; valid by the schema of its version, wherever the type has one."""
    (found,) = station.publications(kind, 1, pdu, HERE, NOW_MS)
    envelope: dict[str, Any] = json.loads(found.payload)
    if (name := TOPICS.get(kind, kind)) in WITH_SCHEMA:
        orange.check(name, envelope)
    return envelope


def refused(kind: str, pdu: bytes, station: Profile = OURS) -> str:
    """Why a message is not sent."""
    with pytest.raises(RequestError) as error:
        sent(kind, pdu, station)
    before, _, why = error.value.message.partition(f'{kind}: cannot be written as "json/raw": ')
    assert not before
    return why


def sent_or_refused(kind: str, pdu: bytes) -> dict[str, Any] | None:
    """The envelope; None for a message that is refused with the path of a value without a form."""
    try:
        return sent(kind, pdu)
    except RequestError as error:
        why = error.__cause__
        assert isinstance(why, ConversionError)
        assert why.path.split(".", maxsplit=1)[0] == "message"
        assert error.message == f'{kind}: cannot be written as "json/raw": {why}'
        return None


def taken(kind: str, envelope: dict[str, Any], station: Profile = OURS) -> bytes:
    topic = f"5GCroCo/outQueue/v2x/{TOPICS.get(kind, kind)}/ora_car_1/1/2/0/2"
    return station.receive(Delivery(topic, json.dumps(envelope).encode())).pdu


def is_raw(envelope: dict[str, Any]) -> bool:
    return "payload" not in envelope["message"]


def decoded(name: str, pdu: bytes) -> Any:
    return captain_messages.find(name).decode(pdu)


# In.


def test_the_cam_of_their_application_is_received():
    envelope = json.loads((orange.HERE / "orange-cam-240.json").read_text())
    value = decoded("cam-1.3.2", taken("cam", envelope))
    position = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    assert (position["latitude"], position["longitude"]) == (533_613_367, -65_056_200)
    assert value["header"] == {"protocolVersion": 1, "messageID": 2, "stationID": 1234}


VEHICLE: dict[str, Any] = {
    "type": "cam",
    "origin": "self",
    "version": "1.1.3",
    "source_uuid": "ora_car_1",
    "timestamp": NOW_MS,
    "message": {
        "protocol_version": 1,
        "station_id": 42,
        "generation_delta_time": 3,
        "basic_container": {
            "station_type": 5,
            "reference_position": {"latitude": 486_263_556, "longitude": 22_492_123, "altitude": 20_000},
            "confidence": {"position_confidence_ellipse": {"semi_major_confidence": 10}, "altitude": 1},
        },
        "high_frequency_container": {
            "heading": 180,
            "speed": 1389,
            "yaw_rate": 4,
            "acceleration_control": "0000011",
            "confidence": {"heading": 2, "speed": 3},
        },
        "low_frequency_container": {
            "exterior_lights": "10011010",
            "path_history": [{"path_position": {"delta_latitude": -5}}],
        },
    },
}


def test_a_cam_1_1_3_of_their_vehicle_has_their_values_and_the_defaults_of_the_schema():
    orange.check("cam", VEHICLE)
    parameters = decoded("cam-1.3.2", taken("cam", VEHICLE))["cam"]["camParameters"]
    position = parameters["basicContainer"]["referencePosition"]
    assert position["altitude"] == {"altitudeValue": 20_000, "altitudeConfidence": "alt-000-02"}
    assert list(position["positionConfidenceEllipse"].values()) == [10, 4095, 3601]
    _, car = parameters["highFrequencyContainer"]
    assert car["heading"] == {"headingValue": 180, "headingConfidence": 2}
    assert car["speed"] == {"speedValue": 1389, "speedConfidence": 3}
    assert car["yawRate"] == {"yawRateValue": 4, "yawRateConfidence": "unavailable"}
    assert car["vehicleWidth"] == 62
    assert car["accelerationControl"] == (b"\x06", 7)
    _, lights = parameters["lowFrequencyContainer"]
    assert lights["exteriorLights"] == (b"\x9a", 8)
    assert lights["pathHistory"][0]["pathPosition"] == {
        "deltaLatitude": -5,
        "deltaLongitude": 131_072,
        "deltaAltitude": 12_800,
    }


@pytest.mark.parametrize("name", orange.files())
def test_values_that_follow_a_schema_are_read_or_refused_with_their_path(name: str):
    kind = name.split("_", maxsplit=1)[0].replace("poim", "poi")
    outcomes = set()
    for seed in range(SAMPLES):
        envelope = orange.sample(name, seed)
        orange.validator(name).validate(envelope)
        try:
            taken(kind, envelope)
            outcomes.add("read")
        except RefusedError as error:
            assert error.reason in (Reason.PAYLOAD, Reason.SHORT_PDU)
            assert error.message.count(": ") >= 1
            outcomes.add("refused")
    assert name not in READ or "read" in outcomes


@pytest.mark.parametrize("name", READ)
def test_what_is_read_of_a_schema_is_sent_again_as_the_newest_one_says(name: str):
    kind, count = name.split("_", maxsplit=1)[0], 0
    for seed in range(SAMPLES):
        try:
            pdu = taken(kind, orange.sample(name, seed))
        except RefusedError:
            continue
        envelope = sent_or_refused(kind, pdu)
        if envelope and is_raw(envelope):
            assert taken(kind, envelope, THEIRS) == pdu
            count += 1
    assert count


@pytest.mark.parametrize("name", READ)
def test_a_value_of_another_kind_anywhere_is_read_or_refused(name: str):
    kind = name.split("_", maxsplit=1)[0]
    for seed in range(SAMPLES):
        envelope = orange.sample(name, seed)
        orange.disturb(envelope["message"], seed)
        try:
            assert taken(kind, envelope)
        except RefusedError as error:
            assert error.message


@pytest.mark.parametrize(
    ("kind", "path", "value", "says"),
    [
        ("cam", ["basic_container", "station_type"], "car", "message.basic_container.station_type: 'car' is not"),
        ("cam", ["high_frequency_container", "speed"], "fast", "speed.value: 'fast' is not an integer"),
        ("cam", ["low_frequency_container", "exterior_lights"], "10x", "exterior_lights: '10x' is not bits"),
        ("cam", ["protocol_version"], 7, "message.protocol_version: 7: no edition of cam has this protocolVersion"),
    ],
)
def test_an_invalid_value_of_a_cam_1_1_3_is_refused_with_its_path(kind: str, path: list[str], value: Any, says: str):
    envelope = json.loads(json.dumps(VEHICLE))
    holder = envelope["message"]
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    with pytest.raises(RefusedError, match=says):
        taken(kind, envelope)


@pytest.mark.parametrize(
    ("kind", "version", "says"),
    [
        ("srem", "2.0.1", 'message_format: "json/raw" of \'srem\' is not read; the sender has to choose "asn1/uper"'),
        ("cpm", "2.0.1", "version: '2.0.1': the JSON of a cpm is supported from version 2.1.0 on"),
    ],
)
def test_json_of_another_structure_is_refused_by_its_format_or_version(kind: str, version: str, says: str):
    with pytest.raises(RefusedError, match=says):
        taken(kind, orange.sample(orange.file_of(kind, version), 1))


@pytest.mark.parametrize(("kind", "pdu"), VECTORS)
def test_a_pdu_in_base64_is_received_of_every_type(kind: str, pdu: bytes):
    assert taken(kind, in_envelope(kind, pdu)) == pdu


# Out.


@pytest.mark.parametrize(("kind", "pdu"), SENDABLE)
def test_a_message_of_another_implementation_is_sent_and_comes_back(kind: str, pdu: bytes):
    envelope = sent(kind, pdu)
    assert taken(kind, envelope, THEIRS) == pdu
    assert is_raw(envelope) is (kind in RAW)


@pytest.mark.parametrize(("kind", "size"), WITHOUT_JSON)
def test_a_message_that_its_schema_cannot_hold_is_refused_with_its_path(kind: str, size: int):
    (pdu,) = (pdu for of, pdu in VECTORS if (of, len(pdu)) == (kind, size))
    assert refused(kind, pdu).startswith(WITHOUT_JSON[kind, size])


@pytest.mark.parametrize("kind", WITHOUT_FORM)
def test_a_type_whose_schema_refers_to_one_that_is_absent_is_refused(kind: str):
    newest = max(name for name in orange.files() if name.startswith(kind))
    assert "dsrc_schema_1-0-0.json" in (orange.FOLDER / newest).read_text()
    assert refused(kind, PDU) == f"the schema of {kind} refers to a schema that its-client does not have"


@pytest.mark.parametrize("kind", ["cam", "denm", "cpm"])
def test_a_message_has_the_position_where_their_library_looks_for_it(kind: str):
    names = {"cam": "cam-1.4.1", "denm": "denm-1.3.1", "cpm": "cpm-2.1.1"}
    places = {
        "cam": ("basic_container", "reference_position"),
        "denm": ("management", "event_position"),
        "cpm": ("management_container", "reference_position"),
    }
    pdus = orange_values.pdus(captain_messages.find(names[kind]), 20, "position")
    raw = [envelope for pdu in pdus if (envelope := sent_or_refused(kind, pdu)) and is_raw(envelope)]
    assert raw
    for envelope in raw:
        message = envelope["message"]
        assert {"protocol_version", "station_id"} <= set(message)
        first, second = places[kind]
        assert {"latitude", "longitude", "altitude"} <= set(message[first][second])


EDITIONS = [one for one in captain_messages.all() if one.type in RAW]
TR = "cpm-tr-2.1.1"  # TR 103 562: a CPM of other containers, which no schema from 2.1.0 on has


@pytest.mark.parametrize("message", EDITIONS, ids=lambda message: message.name)
@pytest.mark.parametrize("has_extensions", [False, True])
def test_every_message_of_an_edition_is_sent_and_valid_or_refused_with_its_path(message: Any, has_extensions: bool):
    raw = 0
    for pdu in orange_values.pdus(message, SAMPLES, "valid", has_extensions):
        envelope = sent_or_refused(message.type, pdu)
        if envelope is None:
            assert message.type != "cam"
            continue
        raw += is_raw(envelope)
        back = taken(message.type, envelope, THEIRS)
        assert back == pdu if not is_raw(envelope) else back[:2] == pdu[:2]
        assert is_raw(envelope) or message.type == "cam"
    assert bool(raw) is (message.name != TR)


@pytest.mark.parametrize("name", ["cam-1.4.1", "denm-1.3.1", "cpm-2.1.1", "spatem-2.1.1"])
def test_a_message_of_a_preferred_edition_comes_back_as_it_was(name: str):
    kind, raw = name.split("-", maxsplit=1)[0], 0
    for pdu in orange_values.pdus(captain_messages.find(name), SAMPLES, "back", has_extensions=True):
        if envelope := sent_or_refused(kind, pdu):
            raw += is_raw(envelope)
            assert taken(kind, envelope, THEIRS) == pdu
    assert raw >= SAMPLES // 4


@pytest.mark.parametrize(
    ("kind", "number", "version"), [("mcm", 20, "2.0.0"), ("poi", 3, "2.0.0"), ("cam", 2, "2.4.0")]
)
def test_octets_are_sent_in_the_schema_that_has_them(kind: str, number: int, version: str):
    envelope = sent(kind, bytes((1, number)) + PDU[2:])
    assert (envelope["message_type"], envelope["message_format"], envelope["version"]) == (kind, "asn1/uper", version)
    assert taken(kind, envelope, THEIRS)[1] == number


def test_without_the_message_library_octets_are_sent_where_the_schema_has_them_and_received_of_every_type():
    station = Profile(load("orange"), Identity("vm", 1, "com_car_1", ""))
    for kind, pdu in VECTORS:
        assert taken(kind, in_envelope(kind, pdu), station) == pdu
        if kind in RAW and kind != "cam":
            assert refused(kind, pdu, station) == "it needs the message library"
            continue
        envelope = sent(kind, pdu, station)
        assert envelope["message_format"] == "asn1/uper"
        assert taken(kind, envelope, THEIRS) == pdu
    with pytest.raises(RefusedError, match="message_format: 'json/raw' is not read"):
        taken("cam", VEHICLE, station)


# The schemas.


@pytest.mark.parametrize("name", orange.files())
def test_a_copy_of_a_schema_is_one_and_has_facts_only(name: str):
    text = (orange.FOLDER / name).read_text()
    Draft202012Validator.check_schema(orange.schema(name))
    assert not any(f'"{word}":"' in text for word in ("description", "$comment", "title"))
    with pytest.raises(ValidationError):
        orange.validator(name).validate({"message_type": "x"})
