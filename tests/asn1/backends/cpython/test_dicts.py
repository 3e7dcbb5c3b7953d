"""captain_messages: what decode gives are ordinary objects, though dicts share their keys and tuples of few bits are kept."""

import copy
import gc
import json
import pickle
import weakref

import pytest

from tests.asn1.codec import CAM, CAM_OCTETS, IDS, REAL, captain_messages, real

KEYS = ["protocolVersion", "messageID", "stationID"]
MAPEM = captain_messages.find("mapem-2.1.1")
MAPEM_OCTETS = real("mapem-2.1.1", 536)


def header():
    return CAM.decode(CAM_OCTETS)["header"]


def test_a_dict_that_changes_does_not_change_another():
    changed, other = header(), header()
    before = dict(other.items())
    changed["extra"] = 1
    del changed["messageID"]
    changed[7] = "not a str"
    assert list(changed) == ["protocolVersion", "stationID", "extra", 7]
    assert list(other) == list(header()) == KEYS
    assert other == header() == before


def test_a_key_that_comes_back_is_the_last():
    value = header()
    number = value.pop("protocolVersion")
    assert list(value) == KEYS[1:]
    assert "protocolVersion" not in value
    value["protocolVersion"] = number
    assert list(value) == [*KEYS[1:], KEYS[0]]
    assert value == header()
    assert CAM.encode(CAM.decode(CAM_OCTETS) | {"header": value}) == CAM_OCTETS


def test_every_method_of_a_dict_works():
    value = header()
    assert value.popitem() == ("stationID", header()["stationID"])
    assert value.setdefault("new", 5) == 5
    assert value | {"x": 1} == {**value, "x": 1}
    value.update({str(number): number for number in range(100)})
    assert len(value) == 103
    assert list(reversed(header())) == KEYS[::-1]
    value.clear()
    assert value == {}
    value["messageID"] = 1
    assert value == {"messageID": 1}


@pytest.mark.parametrize(("name", "octets"), REAL, ids=IDS)
def test_copies_are_equal_and_are_encoded_alike(name, octets):
    message = captain_messages.find(name)
    value = message.decode(octets)
    for other in (copy.deepcopy(value), value.copy(), pickle.loads(pickle.dumps(value))):
        assert other == value
        assert message.encode(other) == octets


def test_json_takes_it():
    value = header()
    assert json.loads(json.dumps(value)) == value


def test_the_dict_of_an_object_is_a_dict():
    class Header: ...

    given = Header()
    for key in (*KEYS[1:], KEYS[0]):
        setattr(given, key, header()[key])
    assert CAM.encode(CAM.decode(CAM_OCTETS) | {"header": vars(given)}) == CAM_OCTETS
    del given.messageID
    with pytest.raises(captain_messages.EncodeError, match="missing"):
        CAM.encode(CAM.decode(CAM_OCTETS) | {"header": vars(given)})


def test_a_decoded_dict_may_be_the_dict_of_an_object():
    class Header: ...

    given = Header()
    given.__dict__ = header()
    expected = header()["messageID"] + 100
    for _ in range(100):  # long enough for the interpreter to specialise
        given.messageID += 1
    given.extra = 1
    assert vars(given) == {**header(), "messageID": expected, "extra": 1}
    assert list(header()) == KEYS


def test_a_ring_of_decoded_dicts_is_collected():
    class Mark: ...

    value = CAM.decode(CAM_OCTETS)
    mark = Mark()
    gone = weakref.ref(mark)
    value["cam"]["ring"] = value
    value["cam"]["mark"] = mark
    del value, mark
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("number", [0, 1, 255, 256, 257, 65535, 2**30 - 1, 2**30, 2**31, 2**32 - 1])
def test_a_number_comes_back(number):
    value = CAM.decode(CAM_OCTETS)
    value["header"]["stationID"] = number
    assert CAM.decode(CAM.encode(value))["header"]["stationID"] == number


@pytest.mark.parametrize("number", [-900_000_000, -(2**29), -257, -256, -255, -6, -5, -1, 0, 256, 257, 900_000_000])
def test_a_signed_number_comes_back_and_can_be_counted_with(number):
    value = CAM.decode(CAM_OCTETS)
    value["cam"]["camParameters"]["basicContainer"]["referencePosition"]["latitude"] = number
    decoded = CAM.decode(CAM.encode(value))["cam"]["camParameters"]["basicContainer"]["referencePosition"]["latitude"]
    assert (decoded, decoded + 1, hash(decoded), str(decoded)) == (number, number + 1, hash(number), str(number))


def test_bits_come_back_whatever_they_are():
    value = MAPEM.decode(MAPEM_OCTETS)
    attributes = value["map"]["intersections"][0]["laneSet"][0]["laneAttributes"]
    for number in range(1024):
        attributes["sharedWith"] = ((number << 6).to_bytes(2, "big"), 10)
        attributes["directionalUse"] = (((number & 3) << 6).to_bytes(1, "big"), 2)
        assert MAPEM.decode(MAPEM.encode(value)) == value
