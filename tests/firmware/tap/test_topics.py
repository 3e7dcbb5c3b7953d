"""Which filters a back end asks for, and that what vehicles publish and receive is read through them."""

import pytest
from paho.mqtt.client import topic_matches_sub

from board.runtime.errors import ConfigurationError, RequestError
from drivers.message import Ego, Position
from drivers.mqtt.options import MqttOptions
from drivers.mqtt.profile import codec, load
from drivers.reason import Reason
from drivers.wire.v2n.description import ProfileDescription, PublishRow
from drivers.wire.v2n.message import Delivery, Identity
from drivers.wire.v2n.profile import Profile
from firmware.tap import topics
from firmware.tap.tap import Tap, TapFilter

CAM = bytes.fromhex("02020000053900010203")
# The example of asn1tools.
CAM_OF_ASN1TOOLS = bytes.fromhex(
    "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
)
NOW_MS = 1_795_182_426_000
VEHICLE = Identity("vm", 1337, "com_fleet_car_1", "v2n")
TAP = Identity("tap", 0, "tap", "v2n")
HERE = Ego(0, Position(487668616, 114320680), True)


@pytest.mark.parametrize(
    ("name", "is_published", "expected"),
    [
        ("vcaptain", False, ["v2x/btp/+", "v2x/btp"]),
        ("nap", True, ["vanetza/out/+"]),
        ("vcaptain", True, ["v2x/btp/+"]),
        ("raw", False, ["v2x/+"]),
        ("orange", False, ["v2n/outQueue/v2x/+/+/#"]),
        ("orange", True, ["v2n/inQueue/v2x/+/+/#"]),
    ],
)
def test_everything_of_a_profile_is_asked_for(name: str, is_published: bool, expected: list[str]) -> None:
    assert topics.filters(topics.tapped(load(name), is_published), "v2n") == expected


@pytest.mark.parametrize(("is_published", "queue"), [(True, "inQueue"), (False, "outQueue")])
def test_a_tile_is_a_level_for_each_digit(is_published: bool, queue: str) -> None:
    description = topics.tapped(load("orange"), is_published)
    assert topics.filters(description, "v2n", "1202") == [f"v2n/{queue}/v2x/+/+/1/2/0/2/#"]


@pytest.mark.parametrize("name", ["vcaptain", "raw", "orange"])
def test_what_a_vehicle_publishes_comes_through_the_filters_and_is_read(name: str) -> None:
    description = topics.tapped(load(name), is_published=True)
    (sent,) = Profile(load(name), VEHICLE).publications("cam", 2001, CAM, HERE, NOW_MS)
    asked = topics.filters(description, "v2n")
    assert any(topic_matches_sub(one, sent.topic) for one in asked)
    assert Profile(description, TAP).receive(Delivery(sent.topic, sent.payload)).pdu == CAM


def test_of_what_nap_publishes_in_three_topics_each_message_is_taken_once() -> None:
    description = topics.tapped(load("nap"), is_published=True)
    library = codec(description)
    sent = Profile(load("nap"), VEHICLE, codec(load("nap"))).publications("cam", 2001, CAM_OF_ASN1TOOLS, HERE, NOW_MS)
    asked = topics.filters(description, "")
    tap = Tap(Profile(description, TAP, library), TapFilter())
    tap.is_copy = topics.copies(load("nap"), "")
    for one in sent:
        if any(topic_matches_sub(text, one.topic) for text in asked):
            tap.take(Delivery(one.topic, one.payload))
    assert len(sent) == 3
    assert (tap.counts.total, tap.counts.copies, tap.counts.unread) == (1, 1, {})


def test_delivery_that_the_profile_cannot_read_is_counted_by_its_reason() -> None:
    tap = Tap(Profile(load("raw"), TAP), TapFilter())
    tap.take(Delivery("v2x/cam", b""))
    assert (tap.counts.total, list(tap.counts.unread)) == (0, [Reason.EMPTY_PDU])


def test_a_topic_that_no_vehicle_publishes_to_is_no_copy() -> None:
    is_copy = topics.copies(load("nap"), "")
    assert is_copy("vanetza/own/cam")
    assert not is_copy("vanetza/in/cam")
    assert not is_copy("vanetza/out/" + "x" * 65000)


def test_with_filters_of_its_own_every_form_is_read() -> None:
    description = topics.tapped(load("nap"), is_published=True, has_all=True)
    assert {row.topic for row in description.subscribe} == {row.topic for row in load("nap").publish}


def test_of_several_forms_the_octets_themselves_are_taken() -> None:
    rows = (
        PublishRow("{prefix}/json/{type}", "orange"),
        PublishRow("{prefix}/text/{type}", "base64"),
        PublishRow("{prefix}/octets/{type}", "binary"),
        PublishRow("{prefix}/alarm/{type}", "binary", ("denm",)),
    )
    description = topics.tapped(ProfileDescription("mine", rows, ()), is_published=True)
    assert topics.filters(description, "p") == ["p/octets/+"]


def test_where_no_topic_has_all_types_each_is_taken_where_it_is() -> None:
    rows = (
        PublishRow("text/{type}", "base64", ("cam", "denm")),
        PublishRow("octets/{type}", "binary", ("denm",)),
        PublishRow("json/{type}", "orange", ("cam",)),
    )
    description = topics.tapped(ProfileDescription("mine", rows, ()), is_published=True)
    assert {(row.topic, row.types) for row in description.subscribe} == {
        ("octets/{type}", ("denm",)),
        ("text/{type}", ("cam",)),
    }


def test_a_station_0_is_not_taken_for_the_tap_itself() -> None:
    description = topics.tapped(load("nap"), is_published=True, has_all=True)
    library = codec(description)
    zero = Identity("vm", 0, "u", "")
    tap = topics.identity(MqttOptions(url="mqtt://localhost", client_id="tap"))
    (sent, *_) = Profile(load("nap"), zero, library).publications("cam", 2001, CAM_OF_ASN1TOOLS, HERE, NOW_MS)
    assert Profile(description, tap, library).receive(Delivery(sent.topic, sent.payload)).pdu == CAM_OF_ASN1TOOLS


def test_what_is_sent_from_another_tile_does_not_come_through() -> None:
    description = topics.tapped(load("orange"), is_published=True)
    (sent,) = Profile(load("orange"), VEHICLE).publications("cam", 2001, CAM, HERE, NOW_MS)
    own = "".join(sent.topic.split("/")[5:])
    asked = {tile: topics.filters(description, "v2n", tile) for tile in (own[:12], own[:11] + str(3 - int(own[11])))}
    assert [topic_matches_sub(one, sent.topic) for (one,) in asked.values()] == [True, False]


def test_a_profile_without_tiles_has_none_to_choose() -> None:
    with pytest.raises(RequestError, match="no tiles in its topics"):
        topics.filters(topics.tapped(load("raw"), False), "", "12")


def test_a_prefix_that_cannot_stand_in_a_topic_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="prefix"):
        topics.filters(topics.tapped(load("orange"), False), "v2n/#")


@pytest.mark.parametrize("text", ["", "4", "12a", "0" * 31])
def test_no_quadkey(text: str) -> None:
    with pytest.raises(ValueError, match="invalid quadkey"):
        topics.quadkey(text)


@pytest.mark.parametrize("text", ["a/b", "+", "#", "a\n"])
def test_no_name_of_a_group(text: str) -> None:
    with pytest.raises(ValueError, match="invalid group"):
        topics.group_name(text)


def test_without_a_group_nothing_is_shared() -> None:
    assert topics.shared("", "v2x/+") == "v2x/+"
    assert topics.shared("g", "v2x/+") == "$share/g/v2x/+"
