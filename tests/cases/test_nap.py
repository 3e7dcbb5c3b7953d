"""Vanetza-NAP's examples: each is read to the message that it is, and written with the members that they have."""

import json
from typing import Any

import captain_messages
import pytest

from drivers.mqtt.profile import MessageLibrary
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.message import Sending
from drivers.wire.v2n.payload.nap import NapReceived, NapToSend
from drivers.wire.v2n.profile import Delivery, Profile, RefusedError
from tests.cases.nap import RECEIVED, TO_SEND, body, case, fields, unlike
from tests.drivers.mqtt.model import Bench
from tests.drivers.wire.v2n.station import HERE, NOW_MS, profile

LIBRARY = MessageLibrary(captain_messages.all())
NUMBERS = {"denm": 1, "cam": 2, "spatem": 4, "mapem": 5, "ivim": 6, "cpm": 14, "vam": 16, "mcm": 20}
PLACE = "intersections[0].laneWidth"


@pytest.fixture
def station() -> Profile:
    return profile("nap", station=7)


def sent(kind: str, value: dict[str, Any]) -> bytes:
    return profile("nap", station=7).receive(Delivery(f"vanetza/in/{kind}", json.dumps(value).encode())).pdu


def written(kind: str, pdu: bytes) -> dict[str, Any]:
    """Header and body as this station publishes them."""
    payload = NapReceived(7, LIBRARY).write(Sending(kind, 1, pdu, HERE, NOW_MS))
    found: dict[str, Any] = json.loads(payload)["fields"]
    return found


@pytest.mark.parametrize("kind", TO_SEND)
def test_an_example_to_send_is_a_message_of_its_type_with_all_its_values(kind: str):
    pdu = sent(kind, body(kind))
    assert pdu[1:6] == bytes((NUMBERS[kind], 0, 0, 0, 7))
    name, back = [*written(kind, pdu).items()][1]
    assert name in {"denm", "cam", "spat", "map", "ivi", "payload", "vam"}
    rounded = {f".{PLACE}: 3.25 came back as 325"} if kind == "mapem" else set()
    assert set(unlike(body(kind), back)) == rounded


@pytest.mark.parametrize("kind", RECEIVED)
def test_an_example_of_a_received_message_is_written_with_the_same_members_and_values(kind: str):
    pdu, _ = NapReceived(7, LIBRARY).read(kind, RECEIVED[kind].read_bytes())
    assert written(kind, pdu) == fields(kind)


@pytest.mark.parametrize("name", ["cam", "denm"])
def test_a_cam_and_a_denm_have_the_names_of_release_2(name: str):
    text = json.dumps(written(name, sent(name, body(name))))
    wanted = {"cam": ["semiMajorAxisLength", "messageId"], "denm": ["actionId", "ccAndScc", "messageId"]}
    assert [word for word in wanted[name] if f'"{word}"' not in text] == []
    assert '"messageID"' not in text


@pytest.mark.parametrize("editions", [(), ("vam-1",)])
def test_a_vam_without_a_header_has_the_message_id_of_a_vam(editions: tuple[str, ...]):
    library = MessageLibrary(captain_messages.all(), editions)
    pdu, _ = NapToSend(7, library).read("vam", json.dumps(case("vam")).encode())
    assert pdu[:2] == bytes((1, 16))


def test_a_cpm_whose_containers_have_no_name_is_taken_and_written_so():
    given = case("cpm")
    back = written("cpm", sent("cpm", given))["payload"]
    assert unlike(given, back) == []
    assert back["cpmContainers"][0]["containerData"] == {"orientationAngle": {"value": 0, "confidence": 1}}


def test_an_empty_country_code_is_ten_bits_that_are_not_set_and_comes_back_empty():
    pdu = sent("ivim", case("ivim"))
    value: Any = captain_messages.find("ivim-2.1.1").decode(pdu)
    assert value["ivi"]["mandatory"]["serviceProviderId"]["countryCode"] == (bytes(2), 10)
    assert written("ivim", pdu)["ivi"]["mandatory"]["serviceProviderId"]["countryCode"] == {}


def test_a_country_code_with_a_bit_is_written_as_digits_and_read_again():
    given = case("ivim")
    given["mandatory"]["serviceProviderId"]["countryCode"] = "7040"
    pdu = sent("ivim", given)
    back = written("ivim", pdu)["ivi"]
    assert back["mandatory"]["serviceProviderId"]["countryCode"] == "7040"
    assert sent("ivim", back) == pdu


@pytest.mark.parametrize("value", [{"bit": True}, [], None, 5])
def test_a_country_code_of_another_form_is_refused_with_its_path(value: object):
    given = case("ivim")
    given["mandatory"]["serviceProviderId"]["countryCode"] = value
    with pytest.raises(RefusedError, match=r"vanetza/in/ivim: .*serviceProviderId\.countryCode: .* is not text"):
        sent("ivim", given)


def mapem(width: object) -> dict[str, Any]:
    """The case has no msgIssueRevision, which a MAPEM needs."""
    given = {"msgIssueRevision": 1, **case("mapem-lanewidth")}
    given["intersections"][0]["laneWidth"] = width
    return given


@pytest.mark.parametrize(
    ("width", "number", "is_noted"),
    [(3.25, 325, True), (2.999, 300, True), (0.004, 0, True), (3, 3, False), (3.0, 3, False), (325, 325, False)],
)
def test_a_lane_width_with_a_fraction_is_in_metres_and_an_integer_is_the_value(
    station: Profile, width: float, number: int, is_noted: bool
):
    pdu = station.receive(Delivery("vanetza/in/mapem", json.dumps(mapem(width)).encode())).pdu
    assert written("mapem", pdu)["map"]["intersections"][0]["laneWidth"] == number
    says = f"mapem.map.{PLACE}: {width} read as {width} m (ASN.1 value {number}); write an integer for units of 0.01 m"
    assert station.noted == (says if is_noted else "")


def test_a_note_is_of_one_delivery_and_of_the_first_lane(station: Profile):
    given = mapem(3.25)
    given["intersections"] = [{**given["intersections"][0], "id": {"id": number}} for number in (1, 2, 3)]
    station.receive(Delivery("vanetza/in/mapem", json.dumps(given).encode()))
    assert station.noted.endswith("of 0.01 m; 2 more")
    station.receive(Delivery("vanetza/in/mapem", json.dumps(mapem(3)).encode()))
    assert station.noted == ""


@pytest.mark.parametrize("width", [-0.5, 327.675, 1e300, -3])
def test_a_lane_width_out_of_range_is_refused_with_its_path(width: float):
    with pytest.raises(RefusedError, match=r"laneWidth: .*out of range"):
        sent("mapem", mapem(width))


def test_a_mapem_without_its_revision_is_refused_with_its_path():
    with pytest.raises(RefusedError, match=r"vanetza/in/mapem: mapem-2\.1\.1: .*msgIssueRevision: missing"):
        sent("mapem", case("mapem-lanewidth"))


def test_a_session_tells_the_note_and_why_it_refuses():
    bench = Bench(profile=profile("nap")).accept()
    bench.deliver("vanetza/in/mapem", json.dumps(mapem(3.25)).encode())
    bench.deliver("vanetza/in/ivim", b'{"mandatory":{"serviceProviderId":7}}')
    bench.run(2.0)
    details = talk.parse_details(bench.all(talk.DETAILS)[-1])
    assert details["received_with_note"] == 1
    assert str(details["note"]).startswith(
        f"vanetza/in/mapem: mapem.map.{PLACE}: 3.25 read as 3.25 m (ASN.1 value 325)"
    )
    ((reason, why),) = bench.whys
    assert reason is Reason.PAYLOAD
    assert why.startswith("vanetza/in/ivim: ivim-2")
    assert "serviceProviderId: 7 is not an object" in why
