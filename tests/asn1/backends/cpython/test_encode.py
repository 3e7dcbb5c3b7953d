"""captain_messages: encodes dicts; refuses other objects."""

import copy
import json
import math
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.asn1.codec import CAM, CAM_OCTETS, IDS, REAL, captain_messages, real
from tests.said import tells

EncodeError = captain_messages.EncodeError
POSITION = ("cam", "camParameters", "basicContainer", "referencePosition")


def at(value, path):
    for name in path:
        value = value[name]
    return value


def cam(**position):
    value = CAM.decode(CAM_OCTETS)
    at(value, POSITION).update(position)
    return value


def turned(value):
    """The same with every dict in reverse order and every str another object."""
    if isinstance(value, dict):
        return {"".join(list(key)): turned(inner) for key, inner in reversed(value.items())}
    if isinstance(value, list | tuple):
        return type(value)(turned(inner) for inner in value)
    return "".join(list(value)) if isinstance(value, str) else value


class Raises:
    def __init__(self, error):
        self.error = error

    def __index__(self):
        raise self.error


@pytest.mark.parametrize(("name", "octets"), REAL, ids=IDS)
def test_the_order_and_identity_of_keys_do_not_matter(name, octets):
    message = captain_messages.find(name)
    assert message.encode(turned(message.decode(octets))) == octets


def test_a_subclass_of_dict_is_a_dict():
    class Record(dict):
        def __getitem__(self, key):
            raise AssertionError

    value = CAM.decode(CAM_OCTETS)
    assert CAM.encode(Record(value)) == CAM_OCTETS


def test_an_int_may_be_anything_that_has_an_index():
    class Degrees(int): ...

    class Number:
        def __index__(self):
            return 487668616

    expected = CAM.encode(cam(latitude=487668616))
    assert CAM.encode(cam(latitude=Degrees(487668616))) == expected
    assert CAM.encode(cam(latitude=Number())) == expected


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (900000002, r"900000002 is not in -900000000\.\.900000001"),
        (2**63, "out of range: 9223372036854775808"),
        (-(2**200), "out of range"),
        (10**6000, "out of range"),
        (1.0, "1.0 is of class float, not int"),
        (math.nan, "nan is of class float"),
        (True, "True is of class bool"),
        (None, "None is of class NoneType"),
        ("1", "'1' is of class str"),
        ([], "list"),
        ({}, "dict"),
        (object(), "object"),
        (Raises(ZeroDivisionError("x")), "__index__ raised ZeroDivisionError"),
    ],
    ids=(
        "above",
        "2**63",
        "far below",
        "6000 digits",
        "float",
        "nan",
        "bool",
        "None",
        "str",
        "list",
        "dict",
        "object",
        "raises",
    ),
)
def test_a_wrong_number_is_refused_with_path_and_reason(wrong, reason):
    with pytest.raises(EncodeError, match=reason) as caught:
        CAM.encode(cam(latitude=wrong))
    assert caught.value.path == ".".join((*POSITION, "latitude"))
    assert str(caught.value) == f"{caught.value.path}: {caught.value.reason}"


def test_the_error_of_an_object_is_the_cause():
    error = ZeroDivisionError("x")
    with pytest.raises(EncodeError) as caught:
        CAM.encode(cam(latitude=Raises(error)))
    assert caught.value.__cause__ is error


def test_an_interrupt_is_no_encode_error():
    with pytest.raises(KeyboardInterrupt):
        CAM.encode(cam(latitude=Raises(KeyboardInterrupt())))


def test_a_mistyped_key_is_refused_with_the_nearest_one():
    with pytest.raises(
        EncodeError, match="'lattitude' is no component of ReferencePosition; did you mean 'latitude'"
    ) as caught:
        CAM.encode(cam(lattitude=1))
    assert caught.value.path == ".".join(POSITION)


@pytest.mark.parametrize("key", [7, None, "\ud800", "", "[]", "[0]", ("a",), b"latitude"])
def test_a_key_that_is_no_component_is_refused(key):
    value = CAM.decode(CAM_OCTETS)
    at(value, POSITION)[key] = 1
    with pytest.raises(EncodeError, match="is no component of ReferencePosition"):
        CAM.encode(value)


def test_a_missing_component_is_named():
    value = CAM.decode(CAM_OCTETS)
    del value["cam"]["generationDeltaTime"]
    with pytest.raises(EncodeError, match="missing") as caught:
        CAM.encode(value)
    assert caught.value.path == "cam.generationDeltaTime"


def test_an_item_that_there_is_not_is_refused_with_the_nearest_one():
    value = CAM.decode(CAM_OCTETS)
    at(value, POSITION)["altitude"]["altitudeConfidence"] = "alt-000-03"
    with pytest.raises(EncodeError, match="'alt-000-03' is no item of AltitudeConfidence; did you mean 'alt-000-01'"):
        CAM.encode(value)


def test_an_alternative_that_there_is_not_is_refused():
    value = CAM.decode(CAM_OCTETS)
    parameters = value["cam"]["camParameters"]
    vehicle = parameters["highFrequencyContainer"][1]
    for wrong in (
        ("vehicle", vehicle),
        ("vehicle",),
        (),
        "x",
        None,
        (None, None),
        ("[0]", "text"),
        ["[01]", b"x"],
        [1, 2, 3],
    ):
        parameters["highFrequencyContainer"] = wrong
        with pytest.raises(EncodeError) as caught:
            CAM.encode(value)
        assert caught.value.path.startswith("cam.camParameters.highFrequencyContainer")


@pytest.mark.parametrize("wrong", [None, 1, "x", b"x", [], object(), CAM, ("a", "b")])
def test_a_message_that_is_no_dict_is_refused(wrong):
    with pytest.raises(EncodeError) as caught:
        CAM.encode(wrong)
    assert caught.value.path == ""


def test_lone_surrogates_are_refused():
    value = CAM.decode(CAM_OCTETS)
    at(value, POSITION)["altitude"]["altitudeConfidence"] = "\ud800"
    with pytest.raises(EncodeError):
        CAM.encode(value)


def test_a_dict_that_changes_while_it_is_walked_does_no_harm():
    for change in ("clear", "grow", "replace"):
        value = CAM.decode(CAM_OCTETS)

        class Changes:
            def __index__(self, value=value, change=change):
                position = at(value, POSITION)
                if change == "clear":
                    position.clear()
                    value["cam"].clear()
                    value.clear()
                elif change == "grow":
                    position.update({str(number): number for number in range(1000)})
                else:
                    value["cam"]["camParameters"]["basicContainer"]["referencePosition"] = None
                return 5

        at(value, POSITION)["latitude"] = Changes()
        try:
            assert len(CAM.encode(value)) == len(CAM_OCTETS)
        except EncodeError as error:
            assert error.reason


def test_named_bits_without_their_zeros_are_the_same_message():
    # LaneAttributes-Vehicle is SIZE(8, ...): X.691 16.3
    message = captain_messages.find("mapem-2.1.1")
    value = message.decode(real("mapem-2.1.1", 536))
    attributes = value["map"]["intersections"][0]["laneSet"][2]["laneAttributes"]
    made = set()
    for bits in (1, 3, 8):
        attributes["laneType"] = ("vehicle", (b"\x80", bits))
        message.validate(value)
        made.add(message.encode(value))
    assert len(made) == 1


def test_a_list_that_changes_while_it_is_walked_does_no_harm():
    octets = real("mapem-2.1.1", 536)
    message = captain_messages.find("mapem-2.1.1")
    value = message.decode(octets)
    lanes = value["map"]["intersections"][0]["laneSet"]

    class Clears:
        def __index__(self):
            lanes.clear()
            return 1

    lanes[0]["laneID"] = Clears()
    with pytest.raises(EncodeError, match="shorter"):
        message.encode(value)


def emptied(holder):
    """Drop what a dict or list holds, and write over the memory of what is gone."""
    holder.clear()
    return [bytes(size) for size in range(200) for _ in range(50)]


def acting(base, holder):
    """A class of `base` that empties the holder of its value when somebody asks for its name."""

    class Acting(type):
        def __getattribute__(cls, name):
            if name == "__name__":
                emptied(holder)
            return super().__getattribute__(name)

    return Acting("Acts", (base,), {})


@pytest.mark.parametrize("base", [object, str, float])
@pytest.mark.parametrize("place", ["latitude", "altitude", "key"])
def test_a_class_that_clears_what_holds_its_value_does_no_harm(base, place):
    value = CAM.decode(CAM_OCTETS)
    position = at(value, POSITION)
    acts = acting(base, position)
    if place == "key":
        position[acts()] = 1
    else:
        position[place] = acts()
    with pytest.raises(EncodeError) as caught:
        CAM.encode(value)
    assert "class Acts" in caught.value.reason


@pytest.mark.parametrize("base", [object, str])
def test_a_class_that_clears_the_list_of_its_value_does_no_harm(base):
    message = captain_messages.find("mapem-2.1.1")
    value = message.decode(real("mapem-2.1.1", 536))
    lanes = value["map"]["intersections"][0]["laneSet"]
    lanes[0] = acting(base, lanes)()
    with pytest.raises(EncodeError, match="class Acts"):
        message.encode(value)
    item = at(CAM.decode(CAM_OCTETS), POSITION)["altitude"]
    item["altitudeConfidence"] = acting(base, item)()
    with pytest.raises(EncodeError, match="class Acts"):
        CAM.encode(cam(altitude=item))


def test_an_index_out_of_range_that_clears_what_holds_it_does_no_harm():
    value = CAM.decode(CAM_OCTETS)
    position = at(value, POSITION)

    class Clears:
        def __index__(self):
            emptied(position)
            return 2**70

    position["latitude"] = Clears()
    with pytest.raises(EncodeError, match="a value of class Clears is not in"):
        CAM.encode(value)


def test_a_list_of_a_wrong_size_is_refused_before_it_is_walked():
    message = captain_messages.find("mapem-2.1.1")
    value = message.decode(real("mapem-2.1.1", 536))
    value["map"]["intersections"] *= 1000
    with pytest.raises(EncodeError, match=r"1000 elements, not 1\.\.32") as caught:
        message.encode(value)
    assert caught.value.path == "map.intersections"


def test_what_contains_itself_is_refused():
    for message in captain_messages.all():
        itself = {}
        for name in ("header", "ivi", "payload", "cam", "optional", "value", "nodeRef"):
            itself[name] = itself
        with pytest.raises(EncodeError):
            message.encode(itself)
    itself = []
    itself.append(itself)
    value = CAM.decode(CAM_OCTETS)
    value["cam"]["camParameters"]["highFrequencyContainer"] = ("basicVehicleContainerHighFrequency", itself)
    with pytest.raises(EncodeError):
        CAM.encode(value)


def test_a_view_of_another_edition_is_told_with_both():
    view = captain_messages.find("cam-1.4.1").view(CAM_OCTETS)
    with pytest.raises(EncodeError) as caught:
        captain_messages.find("cam-2.3.1").encode(view)
    assert caught.value.reason.startswith(
        "a view of CAM of ETSI EN 302 637-2 v1.4.1, not of CAM of ETSI TS 103 900 v2.3.1"
    )


@pytest.mark.parametrize("radius", [2**63, -(2**63) - 1, 10**50])
def test_the_limit_of_64_bits_is_told_where_the_standard_has_none(radius):
    zone = {"protectedZoneType": "permanentCenDsrcTolling", "protectedZoneLatitude": 0, "protectedZoneLongitude": 0}
    container = {"protectedCommunicationZonesRSU": [zone | {"protectedZoneRadius": radius}]}
    value = CAM.decode(CAM_OCTETS)
    value["cam"]["camParameters"]["highFrequencyContainer"] = ("rsuContainerHighFrequency", container)
    with pytest.raises(EncodeError, match="does not fit into 64 bits") as caught:
        CAM.encode(value)
    assert caught.value.path.endswith("[0].protectedZoneRadius")


def test_constraint_between_components_is_refused_with_those_that_are_present():
    message = captain_messages.find("denm-2.3.1")
    value = next(message.decode(octets) for edition, octets in REAL if edition == "denm-2.3.1")
    value["denm"]["management"].pop("termination", None)
    value["denm"].pop("situation", None)
    with pytest.raises(captain_messages.ValidateError) as caught:
        message.validate(value)
    assert caught.value.path == "denm"
    assert caught.value.reason.startswith("breaks a constraint of DenmPayload: ((with {..., management (with {..., ")
    assert "situation present, location present}) | (with " in caught.value.reason
    assert tells(caught.value.reason, ") | (with ", "; ", "absent")


def test_a_component_that_json_lacks_is_missing_and_nothing_else():
    with pytest.raises(EncodeError) as caught:
        CAM.from_json("{}")
    assert str(caught.value) == "header: is missing"


def test_a_view_may_stand_in_a_dict():
    view = CAM.view(CAM_OCTETS)
    changed = CAM.encode({"header": {"protocolVersion": 2, "messageID": 2, "stationID": 77}, "cam": view.cam})
    value = CAM.decode(CAM_OCTETS)
    value["header"]["stationID"] = 77
    assert CAM.decode(changed) == CAM.decode(CAM.encode(value))
    with pytest.raises(EncodeError, match="a view of ItsPduHeader, not of CoopAwareness"):
        CAM.encode({"header": view.header, "cam": view.header})


def test_a_view_of_another_message_is_refused():
    other = captain_messages.find("denm-1.3.1").view(real("denm-1.3.1", 404))
    with pytest.raises(EncodeError, match="a view of DENM, not of CAM"):
        CAM.encode(other)


def test_json_and_back_gives_the_octets_again():
    for name, octets in REAL:
        message = captain_messages.find(name)
        text = message.to_json(octets)
        json.loads(text)
        assert message.from_json(text) == octets
        assert message.from_json(text.encode()) == octets


@pytest.mark.parametrize("wrong", ["", "{", "[]", "{}", '{"header": 1}', "null", "\ud800", b"\xff", '{"header":{}}x'])
def test_json_of_something_else_is_an_encode_error(wrong):
    with pytest.raises(EncodeError) as caught:
        CAM.from_json(wrong)
    assert caught.value.reason


def test_validate_takes_dicts_views_and_octets():
    for value in (CAM.decode(CAM_OCTETS), CAM.view(CAM_OCTETS), CAM_OCTETS, bytearray(CAM_OCTETS)):
        assert CAM.validate(value) is None
    with pytest.raises(captain_messages.ValidateError) as caught:
        CAM.validate(cam(latitude=900000002))
    assert caught.value.path == ".".join((*POSITION, "latitude"))
    with pytest.raises(captain_messages.DecodeError):
        CAM.validate(CAM_OCTETS[:-1])


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3) | st.integers(), inner, max_size=3),
    max_leaves=5,
)


def places(value, path=()):
    """Every path in a value: keys and indices."""
    yield path
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from places(inner, (*path, key))
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            yield from places(inner, (*path, index))


def replaced(value, path, new):
    if not path:
        return new
    if isinstance(value, dict):
        return value | {path[0]: replaced(value[path[0]], path[1:], new)}
    items = list(value)
    items[path[0]] = replaced(items[path[0]], path[1:], new)
    return type(value)(items)


@settings(max_examples=200, deadline=None)
@given(data=st.data(), anything=ANYTHING)
def test_any_object_in_any_place_is_encoded_or_refused(data, anything):
    name, octets = data.draw(st.sampled_from(REAL))
    message = captain_messages.find(name)
    value = message.decode(octets)
    place = data.draw(st.sampled_from(list(places(value))))
    try:
        encoded = message.encode(replaced(value, place, anything))
    except EncodeError as error:
        assert error.reason
    else:
        assert message.encode(message.decode(encoded)) == encoded


def test_nothing_is_kept_of_what_was_encoded():
    value = CAM.decode(CAM_OCTETS)
    keys = copy.deepcopy(value)
    station = 4_000_000_123
    value["header"]["stationID"] = station
    before = sys.getrefcount(station), sys.getrefcount(value), sys.getrefcount(value["cam"])
    for _ in range(100):
        CAM.encode(value)
        with pytest.raises(EncodeError):
            CAM.encode(value | {"x": 1})
    assert (sys.getrefcount(station), sys.getrefcount(value), sys.getrefcount(value["cam"])) == before
    assert keys["header"].keys() == value["header"].keys()
