"""The MQTT session on virtual time: connecting, subscriptions, the window of requests, what the station is told."""

from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.errors import ConfigurationError, RequestError
from drivers.message import Ego
from drivers.mqtt_echo import KEPT_S, MOST, Echoes
from drivers.mqtt_profile import load
from drivers.mqtt_session import STEADY_S, Phase
from drivers.mqtt_settings import broker, settings
from drivers.mqtt_subscriptions import REFUSED_S
from drivers.mqtt_window import Accepted
from drivers.reason import Reason
from drivers.wire import v2n_talk as talk
from drivers.wire.v2n import Delivery, Identity, Profile, Publication, Received
from tests.drivers.mqtt_model import CAM, URL, Bench


class Tiles:
    """A profile whose one subscription is the latitude; it publishes as often as it is told."""

    def __init__(self, publications: int = 1, qos: int = 1) -> None:
        self.count, self.qos = publications, qos

    def publications(self, kind: str, btp_port: int, pdu: bytes, own: Ego, now_ms: int) -> list[Publication]:
        return [Publication(f"t{n}", pdu, self.qos, True, None) for n in range(self.count)]

    def subscriptions(self, own: Ego) -> frozenset[tuple[str, int]]:
        return frozenset({(str(own.position.latitude), 1), ("all", 0)})

    def receive(self, delivery: Delivery) -> Received:
        return Received(delivery.payload, None, "")

    def connected(self) -> Publication | None:
        return None

    closing = lost = connected


def tiles(publications: int = 1, qos: int = 1, **how: Any) -> Bench:
    return Bench(profile=cast(Profile, Tiles(publications, qos)), **how)


def vcaptain() -> Bench:
    return Bench(profile=Profile(load("vcaptain"), Identity("vm", 1, "u", "")))


# Settings.


def test_settings_are_read_as_they_were_written():
    given = Bench(qos=0, version="3.1.1", depths=(14, 18), urgent=(1, 4), device="wwan0").settings
    assert settings(given.message()) == given


def test_a_url_without_a_port_has_the_one_that_is_registered():
    assert [broker(url).port for url in ("mqtts://a", "mqtt://a", "mqtt://[::1]:1884")] == [8883, 1883, 1884]
    assert str(broker("mqtt://[::1]:1884")) == "mqtt://[::1]:1884"


@pytest.mark.parametrize(
    ("url", "is_loopback"),
    [
        ("mqtt://localhost", True),
        ("mqtt://127.9.9.9", True),
        ("mqtt://[::1]", True),
        ("mqtt://localhost.example", False),
    ],
)
def test_only_this_machine_is_loopback(url, is_loopback):
    assert broker(url).is_loopback is is_loopback


@pytest.mark.parametrize(
    "url", ["", "http://a", "mqtts://", "mqtts://:1", "mqtts://a:0", "mqtts://a:65536", "mqtts://a/b", "mqtts://a b",
            "mqtts://a?b", "mqtts://a\n"],
)  # fmt: skip
def test_a_url_that_names_no_broker_is_refused(url):
    with pytest.raises(ConfigurationError):
        broker(url)


def test_a_password_in_a_url_is_refused_and_not_shown():
    with pytest.raises(ConfigurationError) as refused:
        broker("mqtts://me:secret@a:99999")
    assert "secret" not in str(refused.value)


# Connecting.


def test_its_link_is_up_when_connection_and_subscriptions_are_acknowledged_and_not_before():
    bench = Bench()
    assert bench.client.calls == ["connect"]
    bench.session.connected(Accepted(), bench.now)
    assert not bench.is_up
    bench.session.subscribed({}, bench.now)
    assert bench.states == [(False, f"{URL}: connects"), (True, f"{URL}: connected")]


def test_a_broker_without_a_connack_is_given_up_and_tried_again():
    bench = Bench(connect_s=15.0)
    bench.run(14.9)
    assert bench.client.calls == ["connect"]
    bench.run(0.2)
    assert bench.states[-1] == (False, f"{URL}: no CONNACK within 15 s")
    bench.run(1.0)
    assert bench.client.calls == ["connect", "drop", "connect"]


def test_it_waits_twice_as_long_after_each_failure_up_to_the_longest():
    bench = Bench()
    waits = []
    for _ in range(9):
        bench.session.failed("refused", bench.now)
        before, calls = bench.now, len(bench.client.calls)
        bench.run(100.0, lambda calls=calls: len(bench.client.calls) > calls)
        waits.append(round(bench.now - before, 6))
    assert waits == [1, 2, 4, 8, 16, 30, 30, 30, 30]


def test_stations_do_not_all_come_back_at_once():
    waits = []
    for jitter in (0.0, 0.5, 1.0):
        bench = Bench()
        bench.jitter = jitter
        bench.session.failed("refused", bench.now)
        bench.run(9.0, lambda bench=bench: len(bench.client.calls) > 1)
        waits.append(bench.now - 1000.0)
    assert waits == [0.5, 0.75, 1.0]


def test_a_broker_that_closes_every_second_is_asked_less_and_less():
    bench = Bench()
    for _ in range(7):
        bench.accept()
        bench.run(1.0)
        bench.session.lost("has closed the connection", bench.now)
        calls = len(bench.client.calls)
        before = bench.now
        bench.run(100.0, lambda calls=calls: len(bench.client.calls) > calls)
    assert bench.now - before == 30.0


def test_a_connection_that_held_is_followed_by_a_short_wait():
    bench = Bench()
    for _ in range(6):
        bench.session.failed("refused", bench.now)
        bench.run(100.0, lambda: bench.session.phase is Phase.CONNECTING)
    bench.accept()
    bench.run(STEADY_S)
    bench.session.lost("gone", bench.now)
    bench.run(0.51)
    assert bench.session.phase is Phase.CONNECTING


def test_the_same_trouble_is_told_once():
    bench = Bench()
    for _ in range(20):
        bench.session.failed("refused", bench.now)
        bench.run(100.0, lambda: bench.session.phase is Phase.CONNECTING)
    assert bench.states == [(False, f"{URL}: connects"), (False, f"{URL}: refused")]


# The bearer.


def test_nothing_is_connected_before_the_bearer_is_up():
    bench = Bench(has_bearer=True)
    bench.run(100.0)
    assert bench.client.calls == []
    bench.bearer(True)
    assert bench.client.calls == ["drop", "connect"]


def test_a_bearer_that_comes_up_ends_the_wait_for_the_next_try():
    bench = Bench(has_bearer=True)
    bench.bearer(True)
    for _ in range(6):
        bench.session.failed("no route", bench.now)
        bench.run(100.0, lambda: bench.session.phase is Phase.CONNECTING)
    bench.session.failed("no route", bench.now)
    bench.run(1.0)
    bench.bearer(False)
    bench.run(100.0)
    calls = len(bench.client.calls)
    bench.bearer(True)
    assert bench.client.calls[calls:] == ["drop", "connect"]
    bench.session.failed("no route", bench.now)
    bench.run(1.01)
    assert bench.client.calls[calls:] == ["drop", "connect", "connect"]  # and the waits begin anew


def test_another_address_makes_another_connection_and_what_was_unacknowledged_leaves_again():
    bench = Bench(has_bearer=True)
    bench.bearer(True)
    bench.accept()
    bench.send(1)
    bench.bearer(True, "wwan1")
    assert bench.client.calls == ["drop", "connect", "drop", "connect"]
    assert not bench.is_up
    bench.accept()
    assert bench.topics == ["v2x/cam", "v2x/cam"]


def test_a_connection_goes_by_the_device_of_its_bearer():
    bench = Bench(has_bearer=True)
    bench.bearer(True, "wwan0")
    bench.bearer(True, "wwan1")
    bench.session.failed("refused", bench.now)
    bench.run(1.0)
    assert bench.client.devices == ["wwan0", "wwan1", "wwan1"]


def test_without_its_bearer_a_connection_is_gone_and_says_so():
    bench = Bench(has_bearer=True)
    bench.bearer(True)
    bench.accept()
    bench.bearer(False)
    assert (bench.client.calls[-1], bench.states[-1]) == ("drop", (False, f"{URL}: waits for its bearer"))
    calls = len(bench.client.calls)
    bench.run(300.0)
    assert (len(bench.client.calls), bench.session.phase) == (calls, Phase.BEARER)


def test_details_keep_why_the_last_connection_ended():
    bench = Bench().accept()
    bench.session.lost("gone", bench.now)
    bench.run(0.51, lambda: bench.session.phase is Phase.CONNECTING)
    bench.accept()
    bench.run(2.0)
    assert talk.parse_details(bench.all(talk.DETAILS)[-1])["last_error"] == "gone"


def test_a_bearer_that_nobody_asked_for_changes_nothing():
    bench = Bench().accept()
    bench.bearer(False)
    assert bench.is_up


# Subscriptions.


def test_each_connection_subscribes_anew():
    bench = Bench().accept()
    bench.session.lost("gone", bench.now)
    bench.run(2.0)
    bench.accept()
    assert bench.client.subscribes == [[("v2x/+", 1)]] * 2


@pytest.mark.parametrize("owed", ["SUBACK", "UNSUBACK"])
def test_what_a_lost_connection_owed_does_not_keep_the_next_from_subscribing(owed):
    bench = tiles().accept()
    bench.move(3)
    bench.run(1.0)
    if owed == "UNSUBACK":
        bench.session.subscribed({}, bench.now)
    bench.session.lost("gone", bench.now)
    bench.run(2.0)
    bench.accept()
    assert bench.client.subscribes[-1] == [("3", 1), ("all", 0)]
    assert bench.is_up


def test_what_one_connection_refused_the_next_is_asked_for():
    bench = Bench()
    bench.session.connected(Accepted(), bench.now)
    bench.session.subscribed({"v2x/+": "Not authorized"}, bench.now)
    bench.session.lost("gone", bench.now)
    bench.run(2.0)
    bench.accept()
    assert bench.client.subscribes == [[("v2x/+", 1)]] * 2
    assert bench.states[-1] == (True, f"{URL}: connected")


def test_a_refused_tile_that_was_left_is_not_told_any_more():
    bench = tiles()
    bench.session.connected(Accepted(), bench.now)
    bench.session.subscribed({"0": "Not authorized"}, bench.now)
    assert "refuses subscription 0" in bench.states[-1][1]
    bench.move(3)
    bench.run(1.0)
    bench.session.subscribed({}, bench.now)
    assert bench.states[-1] == (True, f"{URL}: connected")


def test_what_is_new_is_subscribed_before_what_is_old_is_left():
    bench = tiles().accept()
    bench.move(7)
    bench.run(1.0)
    assert bench.client.subscribes[1:] == [[("7", 1)]]
    assert bench.client.unsubscribes == []
    bench.session.subscribed({}, bench.now)
    assert bench.client.unsubscribes == [["0"]]
    bench.session.unsubscribed(bench.now)
    assert bench.client.subscribes[2:] == []


def test_a_vehicle_that_goes_to_and_fro_at_an_edge_costs_no_packet():
    bench = tiles().accept()
    for _ in range(3):
        bench.move(7)
        bench.run(0.3)
        bench.move(0)
        bench.run(0.8)
    assert (len(bench.client.subscribes), bench.client.unsubscribes) == (1, [])


def test_a_vehicle_that_moves_on_meanwhile_ends_with_what_it_wants_last():
    bench = tiles().accept()
    held = {"0", "all"}
    for latitude in range(1, 20):
        bench.move(latitude)
        bench.run(0.3)
        if latitude % 4 == 0:  # the broker is slow
            settle(bench, held)
    bench.run(5.0, lambda: settle(bench, held) and False)
    settle(bench, held)
    assert held == {"19", "all"}
    assert len(bench.client.subscribes) < 12  # and not each move has cost a packet


def settle(bench: Bench, held: set[str]) -> None:
    """The broker answers what it was asked."""
    client, session = bench.client, bench.session
    while session._subscriptions.awaits():
        if session._subscriptions.awaits()[0] == "SUBACK":
            held |= {name for name, _ in client.subscribes[-1]}
            session.subscribed({}, bench.now)
        else:
            held -= set(client.unsubscribes[-1])
            session.unsubscribed(bench.now)


def test_a_refused_subscription_leaves_the_link_up_and_says_so():
    bench = Bench()
    bench.session.connected(Accepted(), bench.now)
    bench.session.subscribed({"v2x/+": "Not authorized"}, bench.now)
    assert bench.states[-1] == (True, f"{URL}: connected, but refuses subscription v2x/+: Not authorized")
    bench.send()
    assert bench.topics == ["v2x/cam"]


def test_a_refused_subscription_is_asked_for_once_a_minute():
    bench = Bench()
    bench.session.connected(Accepted(), bench.now)
    for asked in range(1, 4):
        bench.session.subscribed({"v2x/+": "Not authorized"}, bench.now)
        bench.run(REFUSED_S - 1.5)
        assert len(bench.client.subscribes) == asked
        bench.run(2.5)
        assert len(bench.client.subscribes) == asked + 1
    bench.session.subscribed({}, bench.now)
    assert bench.states[-1] == (True, f"{URL}: connected")


@pytest.mark.parametrize("is_first", [True, False])
def test_a_broker_without_a_suback_is_given_up(is_first):
    bench = tiles(connect_s=7.0)
    if is_first:
        bench.session.connected(Accepted(), bench.now)
    else:
        bench.accept()
        bench.move(3)
        bench.run(1.0)
    bench.run(7.1)
    assert bench.states[-1] == (False, f"{URL}: no SUBACK within 7 s")
    assert bench.client.calls[1] == "drop"


def test_a_broker_without_an_unsuback_is_given_up():
    bench = tiles(connect_s=7.0).accept()
    bench.move(3)
    bench.run(1.0)
    bench.session.subscribed({}, bench.now)
    bench.run(7.1)
    assert bench.states[-1][1] == f"{URL}: no UNSUBACK within 7 s"


# Requests.


def test_a_request_is_sent_when_the_broker_has_acknowledged_it_and_not_before():
    bench = Bench().accept()
    bench.send(7)
    assert bench.outcomes == {}
    bench.acknowledge(1)
    assert bench.sent == [(7, None, "")]


def test_a_request_of_two_publications_is_sent_when_both_are():
    bench = tiles(publications=2).accept()
    bench.send(7)
    bench.acknowledge(2)
    assert bench.outcomes == {}
    bench.acknowledge(1)
    assert bench.outcomes == {7: None}


def test_what_the_broker_refuses_failed_in_its_words():
    bench = Bench().accept()
    bench.send(7)
    bench.acknowledge(1, "refuses it: Not authorized")
    assert bench.sent == [(7, Reason.SEND_FAILED, f"{URL}: refuses it: Not authorized")]


def test_no_more_are_unacknowledged_than_the_window_holds():
    bench = Bench(in_flight=3).accept()
    for number in range(6):
        bench.send(number)
    assert len(bench.client.published) == 3
    bench.acknowledge(2)
    assert len(bench.client.published) == 4


def test_a_broker_that_takes_one_at_a_time_is_given_one_at_a_time():
    bench = Bench().accept(receive_maximum=1)
    for number in range(5):
        bench.send(number)
        assert len(bench.client.published) == 1
    for token in range(1, 6):
        bench.acknowledge(token)
    assert bench.outcomes == dict.fromkeys(range(5))


def test_what_a_station_sends_beyond_its_window_is_refused():
    bench = Bench(in_flight=2)
    for number in range(6):
        bench.send(number)
    assert bench.outcomes == {4: Reason.QUEUE_FULL, 5: Reason.QUEUE_FULL}


def test_a_request_that_cannot_leave_expires_at_its_deadline_and_says_why():
    bench = Bench()
    bench.session.failed("no route to it", bench.now)
    bench.send(1, lifetime=3.0)
    bench.run(2.9)
    assert bench.outcomes == {}
    bench.run(0.1)
    assert bench.sent == [(1, Reason.EXPIRED, f"{URL}: no route to it")]
    bench.run(60.0, lambda: bench.session.phase is Phase.CONNECTING)
    bench.accept()
    assert bench.client.published == {}


def test_each_request_expires_at_its_own_deadline():
    bench = Bench()
    for number, lifetime in enumerate((7.3, 0.4, 3.6)):
        bench.send(number, lifetime)
    for moment, number in ((0.4, 1), (3.2, 2), (3.7, 0)):
        bench.run(moment - 0.01)
        assert number not in bench.outcomes
        bench.run(0.01)
        assert bench.outcomes[number] is Reason.EXPIRED


def test_a_request_that_comes_too_late_does_not_leave():
    bench = Bench().accept()
    bench.send(1, lifetime=0.0)
    assert (bench.outcomes, bench.client.published) == ({1: Reason.EXPIRED}, {})


def test_an_acknowledgement_after_the_deadline_changes_nothing_but_makes_room():
    bench = Bench(in_flight=1).accept()
    bench.send(1, lifetime=1.0)
    bench.run(1.0)
    assert bench.outcomes == {1: Reason.EXPIRED}
    bench.send(2)
    assert len(bench.client.published) == 1  # the broker still owes an acknowledgement
    bench.acknowledge(1)
    assert len(bench.client.published) == 2
    bench.acknowledge(2)
    assert bench.outcomes == {1: Reason.EXPIRED, 2: None}


def test_what_was_not_acknowledged_leaves_again_in_its_order_if_it_may():
    bench = Bench().accept()
    for number, lifetime in enumerate((0.2, 9.0, 9.0, 9.0)):
        bench.send(number, lifetime, pdu=CAM + bytes([number]))
    bench.acknowledge(3)
    bench.session.lost("gone", bench.now)
    bench.run(1.0)
    bench.send(9, pdu=CAM + b"\x09")
    before = len(bench.client.published)
    bench.accept()
    again = [publication.payload[-1] for token, publication in bench.client.published.items() if token > before]
    assert again == [1, 3, 9]
    assert bench.outcomes == {0: Reason.EXPIRED, 2: None}


def test_tokens_of_an_earlier_connection_mean_nothing():
    bench = Bench().accept()
    bench.send(1)
    bench.session.lost("gone", bench.now)
    bench.acknowledge(1)
    assert bench.outcomes == {}


def test_twenty_unacknowledged_of_a_broker_that_is_gone_each_leave_again_once():
    bench = Bench().accept()
    for number in range(20):
        bench.send(number, 60.0, pdu=CAM + bytes([number]))
    bench.session.lost("gone", bench.now)
    bench.run(1.0)
    bench.accept()
    assert [one.payload[-1] for one in bench.client.published.values()] == [*range(20), *range(20)]
    for token in range(21, 41):
        bench.acknowledge(token)
    assert bench.outcomes == dict.fromkeys(range(20))


def test_what_leaves_again_has_less_time_left():
    bench = Bench().accept()
    bench.send(1, 20.0)
    bench.session.lost("gone", bench.now)
    bench.run(5.5)
    bench.accept()
    assert [one.expiry_s for one in bench.client.published.values()] == [20, 14]


@pytest.mark.parametrize(("qos", "maximum", "expected"), [(0, 2, 0), (1, 2, 1), (1, 1, 1), (1, 0, 0)])
def test_it_leaves_by_a_quality_of_service_that_the_broker_has(qos, maximum, expected):
    bench = tiles(qos=qos).accept(maximum_qos=maximum)
    bench.send()
    assert bench.client.published[1].qos == expected


def test_nothing_is_retained_where_the_broker_cannot():
    bench = tiles().accept(retains=False)
    bench.send()
    assert not bench.client.published[1].retain


def test_a_message_that_is_too_long_for_the_broker_fails_and_says_so():
    bench = Bench().accept(maximum_packet=100)
    bench.send(1, pdu=CAM + bytes(100))
    bench.send(2)
    assert bench.sent == [(1, Reason.SEND_FAILED, f"{URL}: takes no packet of more than 100 octets")]
    assert len(bench.client.published) == 1


@pytest.mark.parametrize(("qos", "words"), [(1, "no PUBACK within 40 s"), (0, "reads nothing for 40 s")])
def test_a_broker_that_acknowledges_nothing_is_given_up(qos, words):
    bench = tiles(qos=qos, keep_alive_s=20).accept()
    bench.send(1, lifetime=1.0)
    bench.run(39.0)
    assert bench.is_up
    bench.run(1.1)
    assert (bench.states[-1], bench.outcomes) == ((False, f"{URL}: {words}"), {1: Reason.EXPIRED})


def test_a_message_that_the_profile_cannot_carry_fails_in_its_words():
    class Unable(Tiles):
        def publications(self, *_: object) -> list[Publication]:
            raise RequestError("no ASN.1 of this edition")

    bench = Bench(profile=cast(Profile, Unable())).accept()
    bench.send(1)
    assert bench.sent == [(1, Reason.SEND_FAILED, f"{URL}: no ASN.1 of this edition")]


# What is received.


def test_a_received_pdu_is_passed_on_with_its_moment_port_and_source():
    bench = vcaptain().accept()
    bench.deliver("v2x/btp/2001", b"other(2001): <AgIAAAU5AAECAwQ=>")
    assert [talk.parse_received(one) for one in bench.all(talk.RECEIVED)] == [
        talk.Received(1_795_182_426_000_000_000, CAM, 2001, "other")
    ]


def test_a_delivery_that_is_refused_is_counted_once_a_beat_with_a_sample():
    bench = Bench().accept()
    for _ in range(3):
        bench.deliver("v2x/cam", b"\x01")
    bench.deliver("elsewhere", CAM)
    bench.deliver("v2x/cam", CAM, is_retained=True)
    assert bench.drops == {}
    bench.run(1.0)
    assert bench.drops == {Reason.SHORT_PDU: 3, Reason.TOPIC: 1, Reason.RETAINED: 1}
    bench.run(5.0)
    assert sum(bench.drops.values()) == 5


def test_another_station_that_says_the_same_is_heard():
    # Two roadside units send one MAPEM. A broker of version 5 sends nobody his own (noLocal).
    bench = Bench().accept()
    bench.send(1)
    bench.deliver("v2x/cam", CAM)
    assert len(bench.all(talk.RECEIVED)) == 1


def test_the_same_payload_in_another_topic_is_no_echo():
    bench = Bench(version="3.1.1").accept()
    bench.send(1)
    bench.deliver("v2x/denm", CAM)
    assert len(bench.all(talk.RECEIVED)) == 1


def test_own_messages_that_come_back_by_an_old_broker_are_known_for_five_seconds():
    bench = Bench(version="3.1.1").accept()
    bench.send(1)
    bench.run(KEPT_S - 0.1)
    bench.deliver("v2x/cam", CAM)
    bench.deliver("v2x/cam", CAM + b"\x00")
    assert len(bench.all(talk.RECEIVED)) == 1
    bench.run(0.2)
    bench.deliver("v2x/cam", CAM)
    assert len(bench.all(talk.RECEIVED)) == 2
    bench.run(1.0)
    assert bench.drops == {Reason.OWN_ECHO: 1}


def test_echoes_are_known_from_when_they_left_last():
    echoes = Echoes()
    echoes.add("t", b"a", 0.0)
    echoes.add("t", b"b", 1.0)
    echoes.add("t", b"a", 4.0)
    assert [echoes.holds("t", b"a", 8.9), echoes.holds("t", b"b", 6.0), echoes.holds("t", b"a", 9.0)] == [
        True,
        False,
        False,
    ]


def test_echoes_are_bounded():
    echoes = Echoes()
    for number in range(2 * MOST):
        echoes.add("t", b"%d" % number, 0.0)
    assert len(echoes._until) <= MOST
    assert echoes.holds("t", b"%d" % (2 * MOST - 1), 1.0)


# What the station is told.


def test_it_says_that_it_lives_once_a_second_when_it_has_nothing_else_to_say():
    bench = Bench(has_bearer=True)
    bench.run(10.0)
    assert 8 <= len(bench.all(talk.ALIVE)) <= 10


def test_what_a_station_does_not_take_is_told_it_later():
    bench = Bench()
    bench.takes = False
    bench.accept()
    for _ in range(3):
        bench.deliver("elsewhere", CAM)
    bench.run(3.0)
    assert (bench.states, bench.drops, bench.all(talk.DETAILS)) == ([(False, f"{URL}: connects")], {}, [])
    bench.takes = True
    bench.run(1.0)
    assert bench.states[-1] == (True, f"{URL}: connected")
    assert bench.drops == {Reason.TOPIC: 3}
    assert len(bench.all(talk.DETAILS)) == 1


def test_details_are_told_when_they_have_changed():
    bench = Bench().accept()
    bench.send()
    bench.acknowledge(1)
    bench.deliver("v2x/denm", CAM + b"\x01")
    bench.run(5.0)
    (told,) = [talk.parse_details(message) for message in bench.all(talk.DETAILS)]
    assert told == {
        "connections": 1,
        "received": 1,
        "published": 1,
        "confirmed": 1,
        "unacknowledged": 0,
        "subscriptions": 1,
        "first_subscriptions": ["v2x/+"],
        "last_error": "",
    }


def test_it_says_on_the_status_topic_that_it_comes_and_goes():
    bench = vcaptain().accept()
    bench.session.close(bench.now)
    said = [(one.topic, one.payload) for one in bench.client.published.values()]
    assert said == [
        ("v2x/status", b"vm: connection established"),
        ("v2x/status", b"vm: connection closing - good bye"),
    ]
    assert bench.client.calls[-1] == "disconnect"


def test_what_it_says_of_itself_counts_for_a_broker_that_takes_one_at_a_time():
    bench = vcaptain()
    bench.send(1)
    bench.accept(receive_maximum=1)
    assert bench.topics == ["v2x/status"]
    bench.acknowledge(1)
    assert bench.topics == ["v2x/status", "v2x/btp/2001"]


def test_what_it_says_of_itself_is_not_said_again_on_the_next_connection():
    bench = vcaptain().accept()
    bench.session.lost("gone", bench.now)
    bench.run(2.0)
    bench.accept()
    assert len(bench.client.published) == 2


def test_closing_tells_what_was_dropped_since_the_last_beat():
    bench = Bench().accept()
    bench.deliver("elsewhere", CAM)
    bench.session.close(bench.now)
    assert bench.drops == {Reason.TOPIC: 1}


# Whatever happens.

STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("send"), st.floats(0.0, 8.0)),
        st.tuples(st.just("run"), st.floats(0.0, 12.0)),
        st.tuples(st.sampled_from(["ack", "refuse", "accept", "fail", "lose", "up", "down"]), st.integers(0, 30)),
    ),
    max_size=60,
)


@given(steps=STEPS, has_bearer=st.booleans(), room=st.integers(1, 5))
def test_each_request_is_answered_once_and_at_its_deadline_at_the_latest(steps, has_bearer, room):
    bench = Bench(has_bearer=has_bearer, in_flight=3)
    deadlines: dict[int, float] = {}
    for what, how in steps:
        step(bench, what, how, deadlines, room)
        assert bench.session._window.unacknowledged <= min(3, room)
        late = [number for number, deadline in deadlines.items() if deadline < bench.now]
        assert set(late) <= set(bench.outcomes)
    bench.run(10.0)
    assert set(bench.outcomes) == set(deadlines)


def step(bench: Bench, what: str, how: float, deadlines: dict[int, float], room: int) -> None:
    session = bench.session
    match what:
        case "send":
            number = len(deadlines)
            deadlines[number] = bench.now + how
            bench.send(number, how)
        case "run":
            bench.run(how)
        case "ack" | "refuse":
            bench.acknowledge(int(how), "no" if what == "refuse" else "")
        case "accept" if session.phase is Phase.CONNECTING:
            bench.accept(receive_maximum=room)
        case "fail" if session.phase is Phase.CONNECTING:
            session.failed("refused", bench.now)
        case "lose" if session.phase is Phase.UP:
            session.lost("gone", bench.now)
        case "up" | "down":
            bench.bearer(what == "up")
