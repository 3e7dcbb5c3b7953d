"""captain_messages: legal messages from scratch, and fields by short name or path."""

from fractions import Fraction

import pytest

from asn1.backends.c.short_names import short_names
from asn1.backends.ros2.access import UNITS
from tests.asn1.codec import CAM, captain_messages
from tests.said import tells

EDITIONS = [message for message in captain_messages.all() if message.ids]
NAMES = [(message, name) for message in EDITIONS for name in message.short_names]
SPECIAL = ("unavailable", "unknown", "notAvailable", "outOfRange", "negativeOutOfRange", "positiveOutOfRange")
SPEED = "cam.camParameters.highFrequencyContainer.basicVehicleContainerHighFrequency.speed.speedValue"
POSITION = "cam.camParameters.basicContainer.referencePosition"
BASIC = "cam.camParameters.basicContainer"


def steps(path):
    return [step for part in path.split(".") for step in part.replace("[", " [").split()]


def at(value, path):
    """The value at a path of a decoded message; * is the chosen alternative."""
    for step in steps(path):
        if step[0] == "[":
            value = value[int(step[1:-1])]
        elif isinstance(value, tuple):
            assert step in ("*", value[0])
            value = value[1]
        else:
            value = value[step]
    return value


def leaf(message, path):
    """Type and unit of the value at a path; of the first open type's row that has the next step."""
    type_, unit = message.type_tree(), None
    for step in steps(path):
        if type_.rows:
            type_ = next(row for _, row in type_.rows if step in [field.name for field in row.fields])
        if step[0] == "[":
            type_ = type_.element
            continue
        field = next(field for field in type_.fields if step in ("*", field.name))
        type_, unit = field.type, field.unit
    return type_, unit or type_.unit


def of_one(unit):
    """The SI value of 1 in a unit."""
    count, _, name = unit.rpartition(" ")
    return Fraction(count or 1) * UNITS[name][0]


def wanted(type_, unit):
    """A value for example(), and what decode gives for it."""
    match type_.kind:
        case "INTEGER":
            special = {number for name, number in type_.names if name in SPECIAL}
            number = next(n for n in (type_.low + 7, type_.low + 2, type_.low) if n <= type_.high and n not in special)
            return (float(number * of_one(unit)) if unit else number), number
        case "ENUMERATED":
            return type_.names[-1][0], type_.names[-1][0]
        case "CHOICE":
            return type_.fields[1].name, (type_.fields[1].name, 0)
        case "BIT STRING":
            assert type_.names[0][1] == 0
            return type_.names[0][0], (b"\x80", type_.low)
        case kind:
            assert kind == "OCTET STRING"
            return "d300", b"\xd3\x00"


@pytest.mark.parametrize("message", EDITIONS, ids=lambda message: message.name)
def test_an_example_of_each_edition_encodes_decodes_and_validates(message):
    value = message.example()
    octets = message.encode(value)
    assert message.decode(octets) == value
    message.validate(octets)
    assert (octets[0] in message.versions, octets[1] in message.ids) == (True, True)
    assert int.from_bytes(octets[2:6]) == 1


@pytest.mark.parametrize(("message", "name"), NAMES, ids=[f"{message.name}-{name}" for message, name in NAMES])
def test_a_short_name_sets_the_field_that_its_path_reads(message, name):
    path = message.short_names[name]
    given, expected = wanted(*leaf(message, path))
    if name == "termination" and message.release == 2:  # such a DENM has no situation
        with pytest.raises(captain_messages.ValidateError, match="situation present"):
            message.example(**{name: given})
        return
    octets = message.encode(message.example(**{name: given}))
    assert at(message.decode(octets), path) == expected
    assert message.example(**{path: given}) == message.example(**{name: given})


def test_every_message_of_a_standard_has_short_names():
    assert not [message.name for message in EDITIONS if "station" not in message.short_names]
    assert all(message.short_names == short_names(message.form_of or message.name) for message in EDITIONS)


def test_example_of_the_module_is_that_of_the_preferred_edition():
    assert captain_messages.example("cam", speed=13.9) == CAM.example(speed=13.9)
    with pytest.raises(KeyError, match="no message 'camm'"):
        captain_messages.example("camm")
    with pytest.raises(TypeError, match="one name, and its fields as keywords"):
        captain_messages.example("cam", "speed")
    with pytest.raises(TypeError, match="are keywords"):
        CAM.example("speed")


@pytest.mark.parametrize(
    ("path", "given", "number"),
    [
        (f"{POSITION}.latitude", 48.7668616, 487668616),
        (f"{POSITION}.latitude", "-0.00000006", -1),
        (f"{POSITION}.latitude", "unavailable", 900000001),
        (f"{POSITION}.altitude.altitudeValue", "3.726e2", 37260),
        (SPEED, 13.9, 1390),
        (SPEED, 13.8949, 1389),
        (SPEED, 0, 0),
        (SPEED, "standstill", 0),
        (f"{BASIC}.stationType", 5, 5),
        (f"{BASIC}.stationType", "passengerCar", 5),
        ("header.stationID", 4294967295, 4294967295),
    ],
)
def test_a_number_is_in_si_units_and_rounded_to_the_nearest_step(path, given, number):
    assert at(CAM.example(**{path: given}), path) == number


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"speed": 200}, f"{SPEED}: out of range: 200 is not in 0..163.82 m/s"),
        ({"speed": 163.83}, f"{SPEED}: out of range: 163.83 is not in 0..163.82 m/s"),
        ({"speed": "fast"}, f"{SPEED}: syntax error: fast is no special value of SpeedValue; a number or unavailable is expected"),
        ({"speed": "1e999"}, f"{SPEED}: out of range: 1e999 is not in 0..163.82 m/s"),
        ({"speed": "9" * 400}, f"{SPEED}: out of range: {'9' * 40}... is not in 0..163.82 m/s"),
        ({"latitude": "unavailble"}, f"{POSITION}.latitude: syntax error: unavailble is no special value of Latitude; a number or unavailable is expected"),
        ({"station": -1}, "header.stationID: out of range: -1 is not in 0..4294967295"),
        ({"station": 1.5}, "header.stationID: syntax error: a whole number is expected at offset 0, found: 1.5"),
        ({"drive_direction": "ahead"}, f"{SPEED.removesuffix('speed.speedValue')}driveDirection: no such alternative: ahead is no item of DriveDirection"),
        ({"speed": None}, "speed: None is not a number, str or bool"),
        ({"sped": 1}, "sped: is no name in cam-1.4.1; did you mean speed?"),
        ({"speedConfidence": 1}, f"speedConfidence: is no short name of cam-1.4.1; write its path: {SPEED.removesuffix('Value')}Confidence"),
        ({f"{BASIC}.speed": 1}, f"{BASIC}: BasicContainer has no component 'speed'"),
        ({f"{SPEED}.x": 1}, f"{SPEED}: SpeedValue has no component 'x'"),
        ({f"{BASIC}[0]": 1}, f"{BASIC}: BasicContainer has no component ''"),
    ],
)  # fmt: skip
def test_an_invalid_field_is_refused_with_path_value_and_range(fields, said):
    with pytest.raises(captain_messages.EncodeError) as refused:
        CAM.example(**fields)
    assert str(refused.value) == said


def test_unknown_name_is_refused_with_the_paths_that_it_could_mean():
    with pytest.raises(captain_messages.EncodeError) as refused:
        captain_messages.example("mapem", lat=48.7)
    assert refused.value.path == "lat"
    paths = (
        "map.intersections[0].refPoint.lat, map.intersections[0].laneSet[0].nodeList.nodes[0].delta.node-LatLon.lat, "
    )
    assert tells(refused.value.reason, "short name", "mapem-2.1.1; ", paths)
    assert refused.value.reason.endswith("more")


def test_a_name_like_no_other_lists_the_short_names():
    with pytest.raises(
        captain_messages.EncodeError, match=r"is no name in cpm-2\.1\.1; short names: station, time, latitude,"
    ):
        captain_messages.example("cpm", zzzzzz=1)


def test_a_path_into_an_absent_container_creates_it():
    low = "cam.camParameters.lowFrequencyContainer"
    value = CAM.example(**{f"{low}.basicVehicleContainerLowFrequency.pathHistory[0].pathDeltaTime": 1.5})
    (point,) = at(value, f"{low}.basicVehicleContainerLowFrequency.pathHistory")
    assert point["pathDeltaTime"] == 150
    with pytest.raises(captain_messages.EncodeError, match=r"one of \[0\] to \[0\]"):
        CAM.example(**{f"{low}.basicVehicleContainerLowFrequency.pathHistory[1].pathDeltaTime": 1.5})


def test_a_path_into_another_alternative_replaces_the_chosen_one():
    value = CAM.example(**{"cam.camParameters.highFrequencyContainer": "rsuContainerHighFrequency"})
    assert value["cam"]["camParameters"]["highFrequencyContainer"] == ("rsuContainerHighFrequency", {})


def test_a_path_into_an_open_type_selects_the_row_with_its_component():
    first = "payload.cpmContainers[0].containerData.perceivedObjects[0]"
    value = captain_messages.example(
        "cpm-2.1.1", **{f"{first}.objectId": 4, f"{first}.position.xCoordinate.value": 12.5}
    )
    (container,) = value["payload"]["cpmContainers"]
    assert container["containerId"] == 5
    assert at(value, f"{first}.position.xCoordinate.value") == 1250


def test_a_cause_of_release_2_takes_number_or_name_and_then_its_sub_cause():
    by_name = captain_messages.example("denm-2.3.1", cause="stationaryVehicle94", sub_cause=2)
    assert by_name["denm"]["situation"]["eventType"]["ccAndScc"] == ("stationaryVehicle94", 2)
    assert captain_messages.example("denm-2.3.1", cause=94, sub_cause=2) == by_name
    with pytest.raises(captain_messages.EncodeError, match="did you mean stationaryVehicle94"):
        captain_messages.example("denm-2.3.1", cause="stationaryVehicle")
