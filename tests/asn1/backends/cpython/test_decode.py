"""captain_messages: octets to dicts."""

import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.asn1.codec import CAM, CAM_OCTETS, IDS, REAL, captain_messages, real

DecodeError = captain_messages.DecodeError


@pytest.mark.parametrize(("name", "octets"), REAL, ids=IDS)
def test_a_real_message_is_encoded_again_octet_for_octet(name, octets):
    message = captain_messages.find(name)
    value = message.decode(octets)
    assert message.encode(value) == octets
    assert message.encode(message.view(octets)) == octets
    assert message.view(octets).to_dict() == value
    assert message.decode(octets) == value


def test_the_shapes_are_those_of_asn1tools():
    cam = CAM.decode(CAM_OCTETS)
    parameters = cam["cam"]["camParameters"]
    name, vehicle = parameters["highFrequencyContainer"]
    assert list(cam) == ["header", "cam"]
    assert cam["header"]["messageID"] == 2
    assert name == "basicVehicleContainerHighFrequency"
    assert isinstance(vehicle["driveDirection"], str)
    assert "lowFrequencyContainer" not in parameters or isinstance(parameters["lowFrequencyContainer"], tuple)


def test_dicts_are_ordinary_dicts():
    header = CAM.decode(CAM_OCTETS)["header"]
    assert type(header) is dict
    header["extra"] = 1
    del header["messageID"]
    assert set(header) == {"protocolVersion", "stationID", "extra"}
    assert CAM.decode(CAM_OCTETS)["header"].keys() == {"protocolVersion", "messageID", "stationID"}
    copy = CAM.decode(CAM_OCTETS)["header"].copy()
    copy.update({str(number): number for number in range(100)})
    assert copy["99"] == 99
    assert len(copy) == 103


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_any_contiguous_buffer_is_taken(kind):
    assert CAM.decode(kind(CAM_OCTETS)) == CAM.decode(CAM_OCTETS)
    assert CAM.view(kind(CAM_OCTETS)).header.messageID == 2


@pytest.mark.parametrize(
    ("wrong", "error"),
    [("0202", TypeError), (None, TypeError), (7, TypeError), (memoryview(CAM_OCTETS)[::2], BufferError)],
    ids=["str", "None", "int", "every second octet"],
)
def test_what_is_no_buffer_is_a_type_error(wrong, error):
    for call in (CAM.decode, CAM.view, CAM.to_json, CAM.text):
        with pytest.raises(error):
            call(wrong)


def test_an_octet_behind_the_end_is_refused():
    for call in (CAM.decode, CAM.view):
        with pytest.raises(DecodeError) as caught:
            call(CAM_OCTETS + b"\0")
        assert caught.value.bit <= 8 * len(CAM_OCTETS)
        assert caught.value.reason


@pytest.mark.parametrize(("name", "octets"), REAL, ids=IDS)
def test_every_truncation_is_refused_with_its_place(name, octets):
    message = captain_messages.find(name)
    for count in range(len(octets)):
        with pytest.raises(DecodeError) as caught:
            message.decode(octets[:count])
        assert 0 <= caught.value.bit <= 8 * count
        assert caught.value.reason in str(caught.value)
        assert caught.value.path in str(caught.value)


@settings(max_examples=150, deadline=None)
@given(octets=st.binary(max_size=400), which=st.integers(0, len(captain_messages.all()) - 1))
def test_random_octets_are_a_message_or_an_error(octets, which):
    message = captain_messages.all()[which]
    try:
        value = message.decode(octets)
    except DecodeError as error:
        assert error.reason
        with pytest.raises(DecodeError):
            message.view(octets)
    else:
        assert message.view(octets).to_dict() == value
        assert message.decode(message.encode(value)) == value


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_real_message_with_changed_octets_is_a_message_or_an_error(data):
    name, octets = data.draw(st.sampled_from(REAL))
    changed = bytearray(octets)
    for _ in range(data.draw(st.integers(1, 3))):
        changed[data.draw(st.integers(0, len(octets) - 1))] = data.draw(st.integers(0, 255))
    message = captain_messages.find(name)
    try:
        value = message.decode(changed)
    except DecodeError as error:
        assert error.reason
    else:
        assert message.decode(message.encode(value)) == value


def test_an_error_names_the_message_that_there_is_not():
    with pytest.raises(KeyError, match=r"cam-1\.4\.1"):
        captain_messages.find("camm")
    with pytest.raises(TypeError):
        captain_messages.find(7)


def test_a_type_finds_its_preferred_edition():
    found = captain_messages.find("cam")
    assert found.type == "cam"
    assert found.rank == min(message.rank for message in captain_messages.all() if message.type == "cam")


def test_a_message_says_what_it_is():
    assert (CAM.name, CAM.type, CAM.release, CAM.module, CAM.pdu) == (
        "cam-1.4.1",
        "cam",
        1,
        "CAM-PDU-Descriptions",
        "CAM",
    )
    assert CAM.standard == "ETSI EN 302 637-2 v1.4.1"
    assert CAM.ids == (2,)
    assert CAM.versions == (2,)
    assert CAM.btp_port == 2001
    assert CAM.is_experimental is False
    assert "cam-1.4.1" in repr(CAM)
    with pytest.raises((AttributeError, TypeError)):
        CAM.name = "other"


def test_threads_decode_and_encode_at_once():
    octets = real("mapem-2.1.1", 536)
    message = captain_messages.find("mapem-2.1.1")
    expected = message.decode(octets)
    wrong: list[object] = []

    def work():
        for _ in range(50):
            value = message.decode(octets)
            if value != expected or message.encode(value) != octets or message.view(octets).to_dict() != expected:
                wrong.append(value)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
