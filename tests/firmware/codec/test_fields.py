import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.codec.fields import LOOKS, brief, chosen, glance
from tests.firmware.codec.standin import Message, Step

HIGH = {"heading": {"headingValue": 900}, "speed": {"speedValue": 1394, "speedConfidence": 1}}


class Fixed(Message):
    """A message of a type that decodes to a given value."""

    value: object = None
    steps: tuple[Step, ...] = ()

    def decode(self, octets):
        return self.value

    def explain(self, octets):
        return self.steps


def fixed(kind: str, value: object, *steps: Step) -> str:
    message = Fixed(f"{kind}-1", (), (), {})
    object.__setattr__(message, "value", value)
    object.__setattr__(message, "steps", steps)
    return glance(message, b"")


def cam(latitude: int = 487668616, **high: object) -> dict[str, object]:
    place = {"latitude": latitude, "longitude": 114320680}
    container = ("basicVehicleContainerHighFrequency", HIGH | high)
    return {
        "header": {"stationID": 1},
        "cam": {"camParameters": {"basicContainer": {"referencePosition": place}, "highFrequencyContainer": container}},
    }


def test_a_cam_says_position_speed_and_heading():
    assert fixed("cam", cam()) == "48.76686 11.43207 13.9 m/s 90 deg"


def test_what_is_not_known_is_said_to_be():
    unknown = cam(900000001, speed={"speedValue": 16383}, heading={"headingValue": 3601})
    assert fixed("cam", unknown) == "no position speed?"


def test_a_denm_of_release_1_says_its_cause_with_its_name():
    value = {"denm": {"situation": {"eventType": {"causeCode": 94, "subCauseCode": 0}}}}
    step = Step("value", 0, 8, "denm.situation.eventType.causeCode", text="94 (stationaryVehicle)")
    assert fixed("denm", value, step) == "stationaryVehicle/0"


def test_a_denm_of_release_2_says_its_cause():
    value = {"denm": {"situation": {"eventType": {"ccAndScc": ("stationaryVehicle94", 2)}}}}
    assert fixed("denm", value) == "stationaryVehicle94/2"


def test_a_denm_that_ends_says_so():
    assert fixed("denm", {"denm": {"management": {"termination": "isCancellation"}}}) == "terminated"


def test_a_cpm_says_how_many_objects():
    value = {"payload": {"cpmContainers": [{"containerData": {"perceivedObjects": [{}, {}]}}]}}
    assert fixed("cpm", value) == "2 objects"


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text() | st.binary() | st.tuples(st.binary(), st.integers()),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(st.text(), inner)
        | st.dictionaries(
            st.sampled_from(["latitude", "longitude", "speedValue", "eventType", "ccAndScc", "intersections", "x"]),
            inner,
        )
    ),
)


@given(st.sampled_from([*LOOKS, "other"]), VALUES)
def test_no_value_is_too_strange_for_a_glance(kind, value):
    assert isinstance(fixed(kind, value), str)


STEPS = [
    Step("enter", 0, 0, "cam.referencePosition"),
    Step("value", 0, 8, "cam.referencePosition.latitude", text="487668616 (48.7668616 degree)", unit="1e-7 degree"),
    Step("value", 8, 8, "objects[0].speed", text="1"),
    Step("value", 16, 8, "objects[1].speed", text="2"),
    Step("value", 16, 8, "objects[1].speedConfidence", text="3"),
]


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("latitude", ["487668616 (48.7668616 degree)"]),
        ("referencePosition", ["487668616 (48.7668616 degree)"]),
        ("referencePosition.latitude", ["487668616 (48.7668616 degree)"]),
        ("speed", ["1", "2"]),
        ("objects", ["1", "2", "3"]),
        ("objects.speed", ["1", "2"]),
        ("peed", []),
    ],
)
def test_a_field_is_named_by_a_part_of_its_path(name, values):
    assert list(chosen(STEPS, [name]).values()) == values


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("latitude", ["latitude"]),
        ("referencePosition", ["referencePosition.latitude"]),
        ("objects", ["objects[0].speed", "objects[1].speed", "objects[1].speedConfidence"]),
        ("speed", ["objects[0].speed", "objects[1].speed"]),
        ("speedConfidence", ["speedConfidence"]),
    ],
)
def test_a_label_is_as_long_as_it_has_to_be(name, labels):
    assert list(brief(chosen(STEPS, [name]), [name])) == labels
