"""Values of a received message: exact, plain, by name and by attribute."""

import copy
import pickle
import sys
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

from captain_client import codec
from captain_client.errors import StationError
from captain_client.message import Message
from tests.firmware.captain_client.test_reception import TOLD

# A CAM of station 2602961571 in Prague: V1.4.1.
CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")
PLACE = "cam.camParameters.basicContainer.referencePosition"


# Own type with one short name.
OWN_TYPE = SimpleNamespace(
    name="note-1",
    short_names={"speed": "header.x"},
    type_tree=lambda: SimpleNamespace(fields=[SimpleNamespace(name=name) for name in ("header", "text", "list")]),
)


def message(pdu: bytes = CAM, kind: str = "cam") -> Message:
    return Message(pdu, TOLD | {"type": kind})


@pytest.fixture
def without_library(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(sys.modules, "captain_messages", None)
    codec._of_header.cache_clear()
    yield
    codec._of_header.cache_clear()


def test_value_has_the_integers_of_the_standard_and_plain_has_degrees():
    cam = message()
    assert codec.value_at(cam.value, f"{PLACE}.latitude") == 500401189
    assert codec.value_at(cam.plain, f"{PLACE}.latitude") == 50.0401189
    assert (cam.edition, cam.error) == ("cam-1.4.1", "")


def test_attribute_is_a_component_with_the_integers_of_the_standard():
    assert message().cam.camParameters.basicContainer.referencePosition.latitude == 500401189
    assert message().header.stationID == 2602961571


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("latitude", 50.0401189),
        ("station", 2602961571),
        (f"{PLACE}.longitude", 14.4050093),
        ("cam.camParameters.nothing", None),
        ("cam.camParameters.lowFrequencyContainer.basicVehicleContainerLowFrequency.pathHistory[0]", None),
    ],
)
def test_get_by_short_name_or_path_is_the_plain_value_or_none(name: str, value: object):
    assert message().get(name) == value


def test_get_with_a_first_component_returns_it():
    cam = message()
    assert cam.get("header") == {"protocolVersion": 2, "messageID": 2, "stationID": 2602961571}
    assert cam.get("cam") == cam.plain["cam"]


def test_get_with_an_absent_first_component_of_an_own_type_returns_none(monkeypatch: pytest.MonkeyPatch):
    decoded = message()._decoded
    monkeypatch.setattr(decoded, "edition", OWN_TYPE)
    assert [decoded.path(name) for name in ("text", "list[0]", "speed")] == ["text", "list[0]", "header.x"]
    with pytest.raises(StationError) as error:
        decoded.path("sped")
    assert error.value.hint == "a path, or one of speed, header, text, list"


def test_get_with_an_unknown_short_name_names_the_known_ones():
    with pytest.raises(StationError, match="sped") as error:
        message().get("sped")
    assert "speed" in error.value.hint


def test_attribute_with_an_unknown_name_raises_attribute_error():
    with pytest.raises(AttributeError):
        _ = message().denm
    assert not hasattr(message(), "__length_hint__")


@pytest.mark.parametrize("pdu", [CAM[:20], CAM[:1], b"", bytes((2, 99)) + CAM[2:]])
def test_message_that_does_not_decode_has_an_error_and_no_values(pdu: bytes):
    bad = message(pdu)
    assert bad.error
    assert bad.edition == ""
    for read in (lambda: bad.value, lambda: bad.plain, lambda: bad.get("speed"), lambda: bad.cam):
        with pytest.raises(StationError):
            read()


def test_message_without_the_library_has_metadata_and_says_how_to_install_it(without_library: None):
    cam = message()
    assert (cam.station, cam.rssi_dbm) == (2602961571, -71)
    with pytest.raises(StationError, match="captain_messages is not installed") as error:
        _ = cam.value
    assert "make wheels" in error.value.hint
    assert "not installed" in cam.error
    assert cam.edition == ""


@pytest.mark.parametrize("duplicate", [lambda one: pickle.loads(pickle.dumps(one)), copy.copy, copy.deepcopy])
@pytest.mark.parametrize("pdu", [CAM, CAM[:20]])
def test_copy_of_a_message_has_its_metadata_and_values(duplicate: Callable[[Message], Message], pdu: bytes):
    for is_decoded in (False, True):
        cam = message(pdu)
        if is_decoded and not cam.error:
            _ = cam.value, cam.plain, cam.cam
        same = duplicate(cam)
        assert (same.pdu, same.rssi_dbm, same.error, same.edition) == (pdu, -71, cam.error, cam.edition)
        if not cam.error:
            assert (same.value, same.get("speed")) == (cam.value, cam.get("speed"))
            assert same.header.stationID == cam.station


def test_edition_of_every_example_is_its_own_or_one_with_the_same_values():
    import captain_messages

    for one in captain_messages.all():
        if not one.ids:
            continue
        pdu = one.encode(one.example())
        found = message(pdu, one.type)
        assert found.error == ""
        assert found.edition.partition("-")[0] == one.type
        assert captain_messages.find(found.edition).leaves(pdu)[0] == one.leaves(pdu)[0], (one.name, found.edition)
