"""Values that Vanetza-NAP's JSON cannot hold, refused with their path."""

import copy
import json
from dataclasses import replace
from typing import Any

import captain_messages
import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ConfigurationError, RequestError
from drivers.mqtt.profile import load
from drivers.reason import Reason
from drivers.wire.v2n.description import PublishRow
from drivers.wire.v2n.payload.si import ConversionError, to_json
from drivers.wire.v2n.payload.si_read import from_json
from drivers.wire.v2n.profile import Delivery, Identity, Profile, RefusedError
from tests.drivers.wire.v2n.payload.nap import CAM, CPM, DENM, LIBRARY, VECTORS, sent, station
from tests.drivers.wire.v2n.station import HERE, NOW_MS, changed
from tests.said import tells

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
        (f"{BASIC}.referencePosition.latitude", 10**400, "latitude: 1000.* is out of range"),
        (f"{BASIC}.referencePosition.latitude", ..., "latitude"),
        (f"{BASIC}.referencePosition.latitud", 1, "latitud: unknown member; known: latitude"),
        (f"{BASIC}.stationType", 5.5, "stationType: 5.5 is not an integer"),
        (f"{BASIC}.stationType", 256, "stationType.*256"),
        (f"{BASIC}.stationType", -1, "stationType.*-1"),
        (f"{BASIC}.referencePosition", [], "referencePosition: an array is not an object"),
        (
            f"{VEHICLE}.driveDirection",
            3,
            "driveDirection: unknown value 3; known: 0 forward, 1 backward, 2 unavailable",
        ),
        (f"{VEHICLE}.driveDirection", "forward", "driveDirection: 'forward' is not a number"),
        (
            f"{VEHICLE}.accelerationControl",
            {"brake": True},
            "accelerationControl.brake: unknown bit; known: brakePedal",
        ),
        (f"{VEHICLE}.accelerationControl", {"accEngaged": 1}, "accelerationControl.accEngaged: 1 is not true or false"),
        (f"{VEHICLE}.accelerationControl", "80", "accelerationControl: '80' is not an object"),
        (HIGH, {}, "highFrequencyContainer: 0 members; a CHOICE has one of"),
        (HIGH, {"a": 1, "b": 2}, "highFrequencyContainer: 2 members"),
        (HIGH, {"bus": {}}, "highFrequencyContainer.bus: unknown alternative; known: basicVehicle"),
        ("header", {"stationId": 1}, "header"),
        ("stationId", "me", "stationI.: 'me' is not a number"),
    ],
)
def test_what_cannot_be_a_message_is_refused_with_its_path(path: str, value: Any, says: str):
    with pytest.raises(RefusedError, match=says) as refused:
        sent("cam", changed(CAM, path, value))
    assert refused.value.reason is Reason.PAYLOAD


def test_a_long_list_of_what_is_known_is_cut():
    cause = {"informationQuality": 7, "eventType": {"ccAndScc": {"nonsense": 0}}}
    with pytest.raises(RefusedError, match="nonsense: unknown alternative") as refused:
        sent("denm", {**DENM, "situation": cause})
    assert len(refused.value.message) == 300


def test_an_unknown_type_is_refused_by_name():
    with pytest.raises(RefusedError, match="type without a codec in the message library: 'nonsense'"):
        sent("nonsense", CAM)


@pytest.mark.parametrize(
    ("change", "below", "says"),
    [
        ({"containerId": 99}, "", "unknown meaning of 99"),
        ({"containerData": {"Other": {}}}, ".Other", "unknown member; known: orientationAngle"),
        ({"containerData": []}, "", "an array is not an object"),
        ({"containerData": None}, "", "null is not an object"),
        ({"containerData": {"OriginatingVehicleContainer": 1}}, ".OriginatingVehicleContainer", "1 is not an object"),
    ],
)
def test_a_container_that_is_not_known_is_refused_with_its_path(change: dict[str, Any], below: str, says: str):
    body = copy.deepcopy(CPM)
    body["cpmContainers"][0] |= change  # type: ignore[operator, index]
    tree: Any = captain_messages.find("cpm-2.1.1").type_tree()
    with pytest.raises(ConversionError, match=says) as refused:
        from_json(tree.fields[1].type, body, "cpm")
    assert refused.value.path == f"cpm.cpmContainers[0].containerData{below}"


@pytest.mark.parametrize("pdu", [bytes.fromhex("02020000000700"), bytes.fromhex("02ee00000007000000")])
def test_message_that_cannot_be_decoded_is_published_as_it_is_with_what_is_missing(pdu: bytes):
    one = station()
    (found,) = one.publications("cam", 2001, pdu, HERE, NOW_MS)
    assert (found.topic, found.payload) == ("vanetza/out/cam_enc", pdu)
    assert tells(one.missing, "cam: ", "cannot", "JSON")
    one.publications("cam", 2001, VECTORS[1][1], HERE, NOW_MS)
    assert one.missing == ""


def test_a_message_that_no_form_of_the_profile_can_hold_is_not_published_and_it_says_why():
    description = replace(load("nap"), publish=(PublishRow("out/{type}", "nap"),))
    one = Profile(description, Identity("vm", 1, "u", ""), LIBRARY)
    with pytest.raises(RequestError, match="cam: cannot be written as JSON"):
        one.publications("cam", 2001, bytes.fromhex("02020000000700"), HERE, NOW_MS)


def test_what_no_edition_knows_is_not_published_and_it_says_where():
    tree: Any = captain_messages.find("cam-1.4.1").type_tree()
    value: Any = captain_messages.find("cam-1.4.1").decode(VECTORS[1][1])
    value["cam"]["camParameters"]["[0]"] = b"\x00"
    with pytest.raises(ConversionError, match=r"cam\.cam\.camParameters\.\[0\]: no edition knows it"):
        to_json(tree, value, "cam")


def test_the_profile_needs_the_library_and_says_so():
    with pytest.raises(ConfigurationError, match="needs the message library"):
        Profile(load("nap"), Identity("vm", 1, "u", ""), None)


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
