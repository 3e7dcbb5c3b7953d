"""leaves(): the values of a message without names, by which editions are compared."""

import pytest

from tests.asn1.codec import REAL, captain_messages

# CAM V1.3.2 of a made value, curvature 386; V1.4.1 reads -74.
VERSION_1 = bytes.fromhex("010200000001c41e005a97ac450dd00a399ffffffc23b7743e00d2afc14dfe3fe9ed0733b590303600")
CAM = next(octets for name, octets in REAL if name == "cam-1.4.1")


def leaves(edition: str, octets: bytes) -> tuple[bytes, int]:
    found: tuple[bytes, int] = captain_messages.find(edition).leaves(octets)
    return found


def test_leaves_of_editions_that_read_the_same_values_are_equal():
    assert leaves("cam-1.4.1", CAM) == leaves("cam-2.1.1", CAM) == leaves("cam-2.3.1", CAM)


def test_leaves_of_editions_that_read_other_values_differ():
    assert leaves("cam-1.3.2", VERSION_1) != leaves("cam-1.4.1", VERSION_1)


@pytest.mark.parametrize("name", sorted({name for name, _ in REAL}))
def test_leaves_differ_where_one_bit_of_the_station_id_differs(name: str):
    octets = next(octets for edition, octets in REAL if edition == name)
    other = octets[:5] + bytes([octets[5] ^ 1]) + octets[6:]
    assert leaves(name, octets) != leaves(name, other)


def test_leaves_differ_where_another_optional_component_has_the_same_value():
    message = captain_messages.find("cam-1.4.1")
    found = []
    for name in ("lateralAcceleration", "verticalAcceleration"):
        value = message.decode(CAM)
        vehicle = value["cam"]["camParameters"]["highFrequencyContainer"][1]
        for other in ("steeringWheelAngle", "lateralAcceleration", "verticalAcceleration"):
            vehicle.pop(other, None)
        vehicle[name] = {f"{name}Value": 5, f"{name}Confidence": 102}
        found.append(leaves("cam-1.4.1", message.encode(value)))
    assert found[0] != found[1]


def test_leaves_are_equal_where_a_newer_edition_has_an_addition_that_is_absent():
    message = captain_messages.find("denm-2.3.1")
    octets = message.encode(message.decode(next(octets for name, octets in REAL if name == "denm-1.3.1")))
    assert leaves("denm-1.3.1", octets) == leaves("denm-2.2.1", octets) == leaves("denm-2.3.1", octets)


def test_leaves_count_what_the_edition_does_not_know():
    message = captain_messages.find("denm-1.3.1")
    octets = next(octets for name, octets in REAL if name == "denm-1.3.1")
    value = message.decode(octets)
    value["denm"]["management"]["[0]"] = b"\x01"
    known, unknown = leaves("denm-1.3.1", octets)
    newer, more = leaves("denm-1.3.1", message.encode(value))
    assert (unknown, more) == (0, 1)
    assert newer != known


def test_leaves_of_octets_that_do_not_decode_are_refused():
    with pytest.raises(captain_messages.DecodeError):
        leaves("cam-1.4.1", CAM[:-1])
