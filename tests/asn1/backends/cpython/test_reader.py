"""captain_messages: readers, which give the values at some paths of a message."""

import gc
import sys

import pytest

from tests.asn1.codec import CAM, CAM_OCTETS, IDS, REAL, captain_messages, real
from tests.asn1.paths import is_readable, paths

PLACE = "cam.camParameters.basicContainer.referencePosition"
MAPEM = captain_messages.find("mapem-2.1.1")
MAPEM_OCTETS = real("mapem-2.1.1", 536)


@pytest.mark.parametrize(("name", "octets"), REAL, ids=IDS)
def test_a_reader_gives_what_decode_gives_at_every_path(name, octets):
    message = captain_messages.find(name)
    there = dict(paths(message.decode(octets)))
    readable = {path: value for path, value in there.items() if is_readable(message, path)}
    assert len(readable) > 0.9 * len(there)
    read = message.reader(*readable)
    assert read(octets) == read(message.view(octets)) == read(bytearray(octets)) == tuple(readable.values())


def test_what_is_absent_is_none():
    absent = (
        "cam.camParameters.lowFrequencyContainer",
        "cam.camParameters.lowFrequencyContainer.basicVehicleContainerLowFrequency.vehicleRole",
        "cam.camParameters.highFrequencyContainer.rsuContainerHighFrequency",
        "cam.camParameters.highFrequencyContainer.rsuContainerHighFrequency.protectedCommunicationZonesRSU[0]",
    )
    assert CAM.reader(*absent)(CAM_OCTETS) == (None,) * len(absent)


def test_an_element_behind_the_last_is_none():
    lanes = len(MAPEM.decode(MAPEM_OCTETS)["map"]["intersections"][0]["laneSet"])
    last, behind = MAPEM.reader(
        f"map.intersections[0].laneSet[{lanes - 1}].laneID", f"map.intersections[0].laneSet[{lanes}].laneID"
    )(MAPEM_OCTETS)
    assert isinstance(last, int)
    assert behind is None


def test_a_default_that_is_left_out_is_read():
    denm = captain_messages.find("denm-1.3.1")
    value = denm.decode(next(octets for name, octets in REAL if name == "denm-1.3.1"))
    value["denm"]["management"].pop("validityDuration", None)
    assert denm.reader("denm.management.validityDuration")(denm.encode(value)) == (600,)  # EN 302 637-3 V1.3.1, Annex A


def test_names_may_be_those_of_python():
    spatem = captain_messages.find("spatem-2.1.1")
    octets = next(octets for name, octets in REAL if name == "spatem-2.1.1")
    path = "spat.intersections[0].states[0].{}[0].eventState"
    first, second = spatem.reader(path.format("state-time-speed"), path.format("state_time_speed"))(octets)
    assert first == second is not None


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("", "path '': CAM has no component ''"),
        ("cam.", "has no component ''"),
        ("cam..camParameters", "has no component ''"),
        ("header.statonID", "ItsPduHeader has no component 'statonID'; did you mean 'stationID'?"),
        ("header.stationID.x", "StationID has no components"),
        ("header[0]", "ItsPduHeader has no elements"),
        ("cam.camParameters.highFrequencyContainer.heading", "has no alternative 'heading'"),
        ("header\0", "a str without NUL"),
        (7, "path 7: a path is a str without NUL"),
    ],
)
def test_a_path_that_leads_nowhere_is_refused(path, words):
    with pytest.raises(ValueError, match=words.replace("?", r"\?")):
        CAM.reader(f"{PLACE}.latitude", path)


@pytest.mark.parametrize("path", ["[", "[]", "[0", "[-1]", "[x]", "[1234567890]", "[0]laneID", "[0].laneID]"])
def test_an_element_that_is_no_number_in_brackets_is_refused(path):
    with pytest.raises(ValueError, match=r"path 'map\.intersections"):
        MAPEM.reader(f"map.intersections[0].laneSet{path}")


def test_a_str_that_utf8_cannot_hold_is_refused():
    with pytest.raises(UnicodeEncodeError):
        CAM.reader("\ud800")


def test_a_reader_without_a_path_is_refused():
    with pytest.raises(ValueError, match="one path at least"):
        CAM.reader()


def test_octets_that_do_not_decode_are_told_as_by_decode():
    read = CAM.reader("header.stationID")
    with pytest.raises(captain_messages.DecodeError) as told:
        CAM.decode(CAM_OCTETS[:-9])
    with pytest.raises(captain_messages.DecodeError, match="truncated") as raised:
        read(CAM_OCTETS[:-9])
    assert str(raised.value) == str(told.value)


def test_a_view_of_something_else_is_refused():
    read = CAM.reader("header.stationID")
    with pytest.raises(TypeError, match="bytes-like object is required"):
        read(MAPEM.view(MAPEM_OCTETS))
    with pytest.raises(TypeError, match="bytes-like object is required"):
        read(CAM.view(CAM_OCTETS).header)


def test_a_reader_outlives_its_message_and_leaves_nothing_behind():
    message = captain_messages.find("cam-1.4.1")
    gc.collect()  # what other tests have left behind
    before = sys.getrefcount(message)
    for _ in range(100):
        read = message.reader(f"{PLACE}.latitude", "header.stationID")
        with pytest.raises(ValueError, match="no component"):
            message.reader(f"{PLACE}.latitude", "header.x")
    del read
    assert sys.getrefcount(message) == before
