"""captain_messages: views, whose values are made when they are touched."""

import gc
import itertools
from collections.abc import Sequence

import pytest

from tests.asn1.codec import CAM, CAM_OCTETS, IDS, REAL, captain_messages, real

MAPEM = captain_messages.find("mapem-2.1.1")
MAPEM_OCTETS = real("mapem-2.1.1", 536)


def seen(view):
    """What to_dict gives, by touching everything."""
    if isinstance(view, captain_messages.ListView):
        return [seen(item) for item in view]
    if isinstance(view, captain_messages.ChoiceView):
        return view.choice, seen(view.value)
    if isinstance(view, captain_messages.RecordView):
        values = {name: getattr(view, name) for name in view.to_dict()}
        return {name: seen(value) for name, value in values.items()}
    return view


@pytest.mark.parametrize(("name", "octets"), REAL, ids=IDS)
def test_a_view_shows_what_decode_gives(name, octets):
    message = captain_messages.find(name)
    assert seen(message.view(octets)) == message.decode(octets)


def test_components_are_attributes_and_absent_ones_are_none():
    view = CAM.view(CAM_OCTETS)
    value = CAM.decode(CAM_OCTETS)
    assert view.header.stationID == value["header"]["stationID"]
    position = view.cam.camParameters.basicContainer.referencePosition
    assert position.latitude == value["cam"]["camParameters"]["basicContainer"]["referencePosition"]["latitude"]
    absent = {"lowFrequencyContainer", "specialVehicleContainer"} - value["cam"]["camParameters"].keys()
    assert absent
    assert all(getattr(view.cam.camParameters, name) is None for name in absent)


def test_a_choice_has_a_name_and_a_value():
    container = CAM.view(CAM_OCTETS).cam.camParameters.highFrequencyContainer
    assert container.choice == "basicVehicleContainerHighFrequency"
    assert container.value.heading.to_dict() == container.to_dict()[1]["heading"]
    assert not hasattr(container, "heading")


def test_a_choice_has_its_alternative_as_attribute_and_an_error_for_another_names_it():
    container = CAM.view(CAM_OCTETS).cam.camParameters.highFrequencyContainer
    assert container.basicVehicleContainerHighFrequency == container.value
    with pytest.raises(AttributeError, match=r"is 'basicVehicle\w+', not 'heading'; \.value is its value"):
        container.heading  # noqa: B018
    assert not hasattr(container, "rsuContainerHighFrequency")


def test_a_list_is_a_sequence():
    lanes = MAPEM.view(MAPEM_OCTETS).map.intersections[0].laneSet
    values = MAPEM.decode(MAPEM_OCTETS)["map"]["intersections"][0]["laneSet"]
    assert isinstance(lanes, Sequence)
    assert len(lanes) == len(values) > 2
    assert [lane.laneID for lane in lanes] == [lane["laneID"] for lane in values]
    assert lanes[-1] == lanes[len(lanes) - 1]
    assert [lane.laneID for lane in lanes[::-2]] == [lane["laneID"] for lane in values[::-2]]
    assert [lane.laneID for lane in reversed(lanes)] == [lane["laneID"] for lane in reversed(values)]
    assert lanes[1] in lanes
    for wrong in (len(lanes), -len(lanes) - 1, 2**70):
        with pytest.raises(IndexError):
            lanes[wrong]
    with pytest.raises(TypeError):
        lanes["0"]


def test_a_name_that_python_cannot_say_has_another():
    octets = real("spatem-2.1.1", 203)
    movement = captain_messages.find("spatem-2.1.1").view(octets).spat.intersections[0].states[0]
    assert movement.state_time_speed == getattr(movement, "state-time-speed")
    assert "state_time_speed" in dir(movement)


def test_a_mistyped_attribute_names_the_nearest():
    with pytest.raises(AttributeError, match="ItsPduHeader has no component 'stationId'; did you mean 'stationID'"):
        CAM.view(CAM_OCTETS).header.stationId  # noqa: B018
    assert not hasattr(CAM.view(CAM_OCTETS), "\ud800")
    with pytest.raises((AttributeError, TypeError)):
        CAM.view(CAM_OCTETS).header = 1


def test_a_part_keeps_the_message_alive():
    position = CAM.view(bytearray(CAM_OCTETS)).cam.camParameters.basicContainer.referencePosition
    others = [CAM.view(CAM_OCTETS[:4] + bytes([number]) + CAM_OCTETS[5:]) for number in range(200)]
    gc.collect()
    expected = CAM.decode(CAM_OCTETS)["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    assert position.to_dict() == expected
    assert len({view.header.stationID for view in others}) == 200


def test_a_view_does_not_change_with_the_octets_it_came_from():
    octets = bytearray(CAM_OCTETS)
    view = CAM.view(octets)
    before = view.to_dict()
    octets[:] = bytes(len(octets))
    octets.clear()
    assert view.to_dict() == before


def test_views_are_equal_as_values():
    one, same = CAM.view(CAM_OCTETS), CAM.view(CAM_OCTETS)
    value = CAM.decode(CAM_OCTETS)
    value["header"]["stationID"] += 1
    other = CAM.view(CAM.encode(value))
    assert one == same
    assert one == same
    assert one != other
    assert one.cam == other.cam
    assert one.header != other.header
    assert one != one.to_dict()
    assert one != one.cam
    with pytest.raises(TypeError):
        hash(one)
    with pytest.raises(TypeError):
        one < same  # noqa: B015


def test_a_view_is_shown_shortly():
    view = CAM.view(CAM_OCTETS)
    assert repr(view) == "<view of CAM: header, cam>"
    assert repr(view.cam.camParameters.highFrequencyContainer).endswith(": basicVehicleContainerHighFrequency>")
    assert repr(MAPEM.view(MAPEM_OCTETS).map.intersections).endswith(": 1 elements>")
    assert {"header", "cam", "to_dict"} <= set(dir(view))


def test_views_come_from_messages_alone():
    for kind in (
        captain_messages.RecordView,
        captain_messages.ListView,
        captain_messages.ChoiceView,
        captain_messages.View,
    ):
        with pytest.raises(TypeError):
            kind()


def test_a_class_of_views_does_not_change():
    view = CAM.view(CAM_OCTETS)
    with pytest.raises(TypeError):
        view.__class__ = captain_messages.ListView
    for kind in (captain_messages.View, captain_messages.RecordView, captain_messages.Message):
        with pytest.raises(TypeError):
            kind.to_dict = None


def test_the_type_tree_holds_the_tables():
    tree = CAM.type_tree()
    assert (tree.kind, tree.name, tree.standard) == ("SEQUENCE", "CAM", "ETSI EN 302 637-2 v1.4.1")
    header = tree.fields[0].type
    station = next(field for field in header.fields if field.name == "stationID")
    assert (station.type.kind, station.type.low, station.type.high) == ("INTEGER", 0, 2**32 - 1)
    assert tree == CAM.type_tree()
    assert hash(tree) == hash(CAM.type_tree())
    assert tree != header


def test_every_bit_is_explained_once():
    for name, octets in REAL:
        steps = captain_messages.find(name).explain(octets)
        assert steps[0].bit == 0
        bits = sorted(
            (step.bit, step.bit + step.width) for step in steps if step.what not in {"enter", "leave"} and step.width
        )
        assert all(end <= start for (_, end), (start, _) in itertools.pairwise(bits))
        assert bits[-1][1] == 8 * len(octets)


def test_what_does_not_decode_is_explained_as_far_as_it_goes():
    whole, part = CAM.explain(CAM_OCTETS), CAM.explain(CAM_OCTETS[:20])
    assert 0 < len(part) < len(whole)
    assert part[0] == whole[0]
    assert CAM.explain(b"") is not None


def test_text_holds_units_and_meanings():
    text = CAM.text(CAM_OCTETS)
    assert "stationID" in text
    assert "latitude" in text
    assert len(text.splitlines()) > 40
