"""Profiles: topics, status, subscriptions, and refused messages of a broker."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ConfigurationError, RequestError
from drivers.mqtt.profile import load, names
from drivers.reason import Reason
from drivers.wire.v2n.description import ProfileDescription, PublishRow, SubscribeRow, Tiles, TypeRule
from drivers.wire.v2n.profile import Delivery, ReceivedPdu, RefusedError
from drivers.wire.v2n.topic import Template
from firmware.topics import ROWS
from tests.drivers.wire.v2n.station import AS_JSON, HERE, NOW_MS, NOWHERE, PDU, delivered, profile

NAMED = sorted({row.name for row in ROWS})


def test_the_legacy_contract_octet_for_octet():
    # The contract's own example: host vm, port 2001.
    (found,) = profile("vcaptain").publications("cam", 2001, PDU, NOWHERE, NOW_MS)
    assert found.topic == "v2x/btp/2001"
    assert found.payload == b"vm(2001): <AgIAAAU5AAECAw==>"
    assert (found.qos, found.retain, found.expiry_s) == (1, False, None)


def test_the_legacy_profile_subscribes_with_and_without_a_port():
    assert profile("vcaptain").subscriptions(NOWHERE) == {("v2x/btp/+", 1), ("v2x/btp", 1)}


def test_the_legacy_status_texts():
    station = profile("vcaptain")
    said = [station.connected(), station.closing(), station.lost()]
    assert [(one.topic, one.payload) for one in said if one] == [
        ("v2x/status", b"vm: connection established"),
        ("v2x/status", b"vm: connection closing - good bye"),
        ("v2x/status", b"vm: lost connection"),
    ]


def test_the_last_will_of_old_boxes_is_an_option():
    station = profile(load("vcaptain").adapted(status_topic="v2xstatus"))
    connected, lost = station.connected(), station.lost()
    assert connected
    assert lost
    assert (connected.topic, lost.topic) == ("v2x/status", "v2xstatus")


def test_a_profile_without_a_status_says_nothing():
    station = profile(load("raw").adapted(status_topic="v2xstatus"))
    assert (station.connected(), station.closing(), station.lost()) == (None, None, None)


def test_the_legacy_port_of_the_topic_is_kept():
    payload = b"vm2(2001): <AgIAAAU5AAECAw==>"
    station = profile("vcaptain")
    assert station.receive(Delivery("v2x/btp/2009", payload)) == ReceivedPdu(PDU, 2009, "vm2")
    assert station.receive(Delivery("v2x/btp", payload)) == ReceivedPdu(PDU, None, "vm2")


def test_what_carries_the_own_host_is_an_echo():
    with pytest.raises(RefusedError) as refused:
        profile("vcaptain").receive(Delivery("v2x/btp/2001", b"vm(2001): <AgIAAAU5AAECAw==>"))
    assert refused.value.reason is Reason.OWN_ECHO


def test_a_host_whose_name_begins_with_ours_is_another():
    for host in (b"vm2", b"vm ", b"v", b"VM"):
        found = profile("vcaptain").receive(Delivery("v2x/btp/1", host + b"(1): <AgIAAAU5AAECAw==>"))
        assert found.source == host.decode()


def test_of_two_ports_that_disagree_the_topics_counts():
    found = profile("vcaptain").receive(Delivery("v2x/btp/2001", b"me(2002): <AgIAAAU5AAECAw==>"))
    assert (found.btp_port, found.source) == (2001, "me")


@pytest.mark.parametrize(
    "topic", ["v2x/btp/", "v2x/btp/-1", "v2x/btp/65536", "v2x/btp/2001x", "v2x/btp/٢", "v2x/btp/000001"]
)
def test_a_topic_without_a_port_number_is_refused(topic: str):
    with pytest.raises(RefusedError, match=r"invalid BTP port|unknown topic") as refused:
        profile("vcaptain").receive(Delivery(topic, b"a(1): <AgIAAAU5AAECAw==>"))
    assert refused.value.reason is Reason.TOPIC


@pytest.mark.parametrize(
    "topic", ["", "v2x", "v2x/btp/1/2", "/v2x/btp/1", "v2x/status", "$SYS/broker/version", "v2x/btp/1\n"]
)
def test_a_topic_outside_the_templates_is_refused_with_what_is_taken(topic: str):
    with pytest.raises(RefusedError) as refused:
        profile("vcaptain").receive(Delivery(topic, b"a(1): <AgIAAAU5AAECAw==>"))
    assert refused.value.reason is Reason.TOPIC


@pytest.mark.parametrize("name", ["vcaptain", "raw", "nap"])
def test_what_the_broker_had_kept_is_refused(name: str):
    topic = {"vcaptain": "v2x/btp/2001", "raw": "v2x/cam", "nap": "vanetza/in/cam_enc"}[name]
    with pytest.raises(RefusedError) as refused:
        profile(name).receive(Delivery(topic, PDU, is_retained=True))
    assert refused.value.reason is Reason.RETAINED


@pytest.mark.parametrize(
    ("pdu", "reason"),
    [
        (b"", Reason.EMPTY_PDU),
        (PDU[:5], Reason.SHORT_PDU),
        (PDU[:6], None),
        (bytes(1500), None),
        (bytes(1501), Reason.LONG_PDU),
    ],
)
def test_a_pdu_has_6_to_1500_octets(pdu: bytes, reason: Reason | None):
    station = profile("raw")
    if reason is None:
        assert station.receive(Delivery("v2x/cam", pdu)).pdu == pdu
        return
    with pytest.raises(RefusedError) as refused:
        station.receive(Delivery("v2x/cam", pdu))
    assert refused.value.reason is reason


@pytest.mark.parametrize("name", ["vcaptain", "raw", "orange", "nap"])
def test_a_payload_above_64_kib_is_not_looked_at(name: str):
    station = profile(name)
    (topic, *_), *_ = sorted(station.subscriptions(HERE))
    topic = topic.replace("+", "cam").replace("/#", "")
    with pytest.raises(RefusedError, match="payload of 65537 octets; at most 65536") as refused:
        station.receive(Delivery(topic, b"<" * 65_537))
    assert refused.value.reason is Reason.PAYLOAD


@pytest.mark.parametrize("kind", NAMED)
def test_every_type_has_a_topic_that_another_station_takes(kind: str):
    (found,) = profile("raw").publications(kind, 2001, PDU, NOWHERE, NOW_MS)
    assert found.topic == f"v2x/{kind}"
    assert profile("raw", "vm2", 2).receive(delivered(found)) == ReceivedPdu(PDU, None, "")


@given(st.binary(min_size=6, max_size=40))
def test_an_unknown_type_is_called_by_its_message_id(pdu: bytes):
    (found,) = profile("raw").publications("", 2001, pdu, NOWHERE, NOW_MS)
    assert found.topic == f"v2x/{pdu[1]}"
    assert profile("raw").receive(delivered(found)).pdu == pdu


def test_a_profile_shares_no_subscription():
    with pytest.raises(ConfigurationError, match="shared subscriptions are not allowed"):
        SubscribeRow("$share/g/{type}", "binary")


def test_two_stations_with_vcaptain_hear_each_other():
    one, other = profile("vcaptain"), profile("vcaptain", "vm2")
    (found,) = one.publications("denm", 2002, PDU, NOWHERE, NOW_MS)
    assert other.receive(delivered(found)) == ReceivedPdu(PDU, 2002, "vm")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("v2x/{tpye}", r"unknown variable of topics: \{tpye\}(?s:.*)did you mean \{type\}\?"),
        ("v2x/{xyz}", r"known: \{host\} \{station\}"),
        ("v2x/{type", "a brace has no partner"),
        ("v2x/type}", "a brace has no partner"),
        ("v2x/+", "no message can be published there"),
        ("v2x/#", "no message can be published there"),
        ("v2x/\0", "no message can be published there"),
        ("", "1 to 65535 octets"),
        ("x" * 65_536, "1 to 65535 octets"),
    ],
)
def test_a_topic_that_cannot_be_is_a_mistake_of_the_profile(text: str, complaint: str):
    with pytest.raises(ConfigurationError, match=complaint):
        Template(text)


@pytest.mark.parametrize("text", ["v2x/#/cam", "v2x/a+", "v2x/a#", "v2x/{type}#", "+v2x", "\0"])
def test_a_filter_that_cannot_be_is_a_mistake_of_the_profile(text: str):
    with pytest.raises(ConfigurationError):
        Template(text, is_filter=True)


@pytest.mark.parametrize("prefix", ["a+", "#", "a\0b", "a\nb"])
def test_a_value_that_no_topic_can_hold_is_told_before_anything_is_sent(prefix: str):
    with pytest.raises(ConfigurationError, match="invalid in a topic"):
        profile("orange", prefix=prefix)


@pytest.mark.parametrize(
    ("name", "identity"), [("orange", {"uuid": ""}), ("vcaptain", {"host": ""}), ("orange", {"uuid": "a/b"})]
)
def test_an_identity_that_the_profile_needs_has_to_be_there(name: str, identity: dict[str, str]):
    with pytest.raises(ConfigurationError):
        profile(name, **identity)


@pytest.mark.parametrize("host", ["a<b", "a>b", "a(b", "a\nb"])
def test_a_host_that_the_legacy_payload_cannot_carry_is_told(host: str):
    with pytest.raises(ConfigurationError, match="invalid in a payload"):
        profile("vcaptain", host)


def test_a_variable_may_come_twice_and_is_the_same():
    station = profile(ProfileDescription("twice", (), (SubscribeRow("{type}/x/{type}-{port}", "binary"),)))
    assert station.subscriptions(HERE) == {("+/x/+", 1)}
    assert station.receive(Delivery("cam/x/cam-2001", PDU)).btp_port == 2001
    with pytest.raises(RefusedError):
        station.receive(Delivery("cam/x/denm-2001", PDU))


def test_a_topic_that_would_take_long_to_match_is_refused():
    station = profile(ProfileDescription("slow", (), (SubscribeRow("{type}{port}x", "binary"),)))
    with pytest.raises(RefusedError, match="longer than 1024") as refused:
        station.receive(Delivery("y" * 65_535, PDU))
    assert refused.value.reason is Reason.TOPIC


def test_all_variables_of_a_topic():
    everything = "{host}/{station}/{uuid}/{type}/{port}/{quadkey}/{prefix}"
    description = ProfileDescription("all", (PublishRow(everything, "binary"),), (), tiles=Tiles(4, 3))
    (found,) = profile(description, "h", 7, "u", "p/q").publications("cam", 2001, PDU, HERE, NOW_MS)
    assert found.topic == "h/7/u/cam/2001/1/2/0/2/p/q"


@pytest.mark.parametrize("kind", ["a/b+", "#", "\0"])
def test_a_type_whose_name_is_no_level_cannot_be_sent(kind: str):
    with pytest.raises(RequestError, match="invalid topic"):
        profile("raw").publications(kind, 1, PDU, HERE, NOW_MS)


def test_a_type_that_no_row_has_cannot_be_sent():
    description = ProfileDescription("few", (PublishRow("v2x/{type}", "binary", ("denm",)),), ())
    assert profile(description).publications("denm", 1, PDU, HERE, NOW_MS)
    with pytest.raises(RequestError, match="profile few has no topic for cam"):
        profile(description).publications("cam", 1, PDU, HERE, NOW_MS)


def test_a_row_with_types_asks_for_each_and_takes_no_other():
    description = ProfileDescription(
        "few",
        (),
        (SubscribeRow("v2x/{type}/{port}", "binary", ("cam", "mapem")),),
        types={"mapem": TypeRule(topic="map", qos=0)},
    )
    station = profile(description)
    assert station.subscriptions(HERE) == {("v2x/cam/+", 1), ("v2x/map/+", 0)}
    assert station.receive(Delivery("v2x/map/5", PDU)).btp_port == 5
    with pytest.raises(RefusedError):
        station.receive(Delivery("v2x/denm/5", PDU))


def test_rules_of_a_type_go_before_those_of_the_profile():
    description = ProfileDescription(
        "rules",
        (PublishRow("v2x/{type}", "binary"),),
        (),
        qos=1,
        expiry_s=30,
        types={"denm": TypeRule(topic="d", qos=0, retain=True, expiry_s=600)},
    )
    station = profile(description)
    (denm,) = station.publications("denm", 1, PDU, HERE, NOW_MS)
    (cam,) = station.publications("cam", 1, PDU, HERE, NOW_MS)
    assert denm[:1] + denm[2:5] == ("v2x/d", 0, True, 600)
    assert cam[:1] + cam[2:5] == ("v2x/cam", 1, False, 30)


def test_an_interface_can_choose_its_quality_of_service():
    station = profile(load("orange").adapted(qos=1))
    assert {qos for _, qos in station.subscriptions(HERE)} == {1}
    assert {one.qos for one in station.publications("mapem", 1, AS_JSON["mapem"], HERE, NOW_MS)} == {1}


@given(st.text(max_size=40), st.binary(max_size=80), st.booleans())
def test_whatever_a_broker_delivers_is_taken_or_explained(topic: str, payload: bytes, is_retained: bool):
    for station in STATIONS:
        for one in (topic, *(known.replace("+", "cam").replace("/#", "") for known, _ in station.subscriptions(HERE))):
            try:
                found = station.receive(Delivery(one, payload, is_retained))
            except RefusedError as error:
                assert error.message
            else:
                assert 6 <= len(found.pdu) <= 1500


STATIONS = [profile(name) for name in names()]
