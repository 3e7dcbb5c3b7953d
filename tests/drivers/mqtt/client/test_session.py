"""MQTT session in virtual time: connection, bearer, reports to the station."""

from typing import cast

import pytest

from drivers.mqtt.client.backoff import STEADY_S
from drivers.mqtt.client.session import Phase
from drivers.mqtt.client.window import Accepted
from drivers.mqtt.profile import load
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.profile import Identity, Profile
from tests.drivers.mqtt.model import CAM, URL, Bench, Tiles, vcaptain
from tests.said import tells

# Connecting.


def test_its_link_is_up_when_connection_and_subscriptions_are_acknowledged_and_not_before():
    bench = Bench()
    assert bench.client.calls == ["connect"]
    bench.session.connected(Accepted(), bench.now)
    assert not bench.is_up
    bench.session.subscribed({}, bench.now)
    assert bench.states == [(False, f"{URL}: connecting"), (True, f"{URL}: connected")]
    assert [talk.parse_state(message).is_starting for message in bench.all(talk.STATE)] == [True, False]


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
    assert bench.states == [(False, f"{URL}: connecting"), (False, f"{URL}: refused")]


# The position.


def by_tile() -> Bench:
    return Bench(profile=Profile(load("orange"), Identity("vm", 1, "u", "p")))


def test_link_of_a_profile_by_tile_without_a_position_is_down_until_there_is_one():
    bench = by_tile()
    bench.session.connected(Accepted(), bench.now)
    is_up, why = bench.states[-1]
    assert not is_up
    assert tells(why, f"{URL}: ", "no position", "published", "subscribed")
    bench.send(1)
    number, reason, detail = bench.sent[0]
    assert (number, reason) == (1, Reason.SEND_FAILED)
    assert tells(detail, f"{URL}: ", "position")
    bench.move(480_000_000)
    bench.run(0.0)
    assert bench.states[-1] == (True, f"{URL}: connected")
    assert len(bench.client.subscribes[-1]) >= 9
    bench.send(2)
    assert len(bench.client.published) == 1


def test_link_of_a_profile_by_tile_is_down_once_the_position_is_lost_for_a_second():
    bench = by_tile()
    bench.move(480_000_000)
    bench.accept()
    for _ in range(3):
        bench.move(480_000_000, is_known=False)
        bench.run(0.5)
        bench.move(480_000_000)
        bench.run(0.5)
    assert bench.states[1:] == [(True, f"{URL}: connected")]
    bench.move(480_000_000, is_known=False)
    bench.run(1.0)
    is_up, why = bench.states[-1]
    assert not is_up
    assert tells(why, f"{URL}: ", "no position", "published")
    assert "subscribed" not in why
    assert bench.client.calls == ["connect"]


# The bearer.


def test_nothing_is_connected_before_the_bearer_is_up():
    bench = Bench(bearer="modem")
    bench.run(100.0)
    assert bench.client.calls == []
    bench.bearer(True)
    assert bench.client.calls == ["drop", "connect"]


def test_a_bearer_that_comes_up_ends_the_wait_for_the_next_try():
    bench = Bench(bearer="modem")
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
    bench = Bench(bearer="modem")
    bench.bearer(True)
    bench.accept()
    bench.send(1)
    bench.bearer(True, "wwan1")
    assert bench.client.calls == ["drop", "connect", "drop", "connect"]
    assert not bench.is_up
    bench.accept()
    assert bench.topics == ["v2x/cam", "v2x/cam"]


def test_a_connection_goes_by_the_device_of_its_bearer():
    bench = Bench(bearer="modem")
    bench.bearer(True, "wwan0")
    bench.bearer(True, "wwan1")
    bench.session.failed("refused", bench.now)
    bench.run(1.0)
    assert bench.client.devices == ["wwan0", "wwan1", "wwan1"]


def test_connection_whose_bearer_goes_down_is_dropped_and_reported():
    bench = Bench(bearer="modem")
    bench.bearer(True)
    bench.accept()
    bench.bearer(False)
    is_up, why = bench.states[-1]
    assert (bench.client.calls[-1], is_up) == ("drop", False)
    assert tells(why, f"{URL}: ", "bearer")
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


# Reports to the station.


def test_it_says_that_it_lives_once_a_second_when_it_has_nothing_else_to_say():
    bench = Bench(bearer="modem")
    bench.run(10.0)
    assert 8 <= len(bench.all(talk.ALIVE)) <= 10


def test_what_a_station_does_not_take_is_told_it_later():
    bench = Bench()
    bench.takes = False
    bench.accept()
    for _ in range(3):
        bench.deliver("elsewhere", CAM)
    bench.run(3.0)
    assert (bench.states, bench.drops, bench.all(talk.DETAILS)) == ([(False, f"{URL}: connecting")], {}, [])
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


def test_message_that_leaves_in_some_forms_of_its_profile_is_counted_with_the_reason():
    profile = Tiles()
    bench = Bench(profile=cast(Profile, profile)).accept()
    bench.run(2.0)
    assert b"in_part" not in bench.all(talk.DETAILS)[-1]
    why = profile.missing = "cam: cannot be written as JSON"
    bench.send(1)
    profile.missing = ""
    bench.send(2)
    bench.run(2.0)
    details = talk.parse_details(bench.all(talk.DETAILS)[-1])
    assert (details["published_in_part"], details["why_in_part"]) == (1, why)
    assert len(bench.client.published) == 2


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


def test_refusal_of_a_delivery_reaches_the_station_with_its_place():
    bench = vcaptain().accept()
    bench.deliver("elsewhere", CAM)
    bench.deliver("v2x/btp/2001", b"other(2001): <AgIA AAU5>")
    bench.run(2.0)
    (of_topic, topic), (of_payload, payload) = bench.whys
    assert (of_topic, of_payload) == (Reason.TOPIC, Reason.PAYLOAD)
    assert topic.startswith("unknown topic 'elsewhere'; known: v2x/btp")
    assert tells(payload, "v2x/btp/2001: ", "base64")


@pytest.mark.parametrize("why", ["", "latitude: '\u00e4\u20ac' is not a number", "lone \udcff", "x" * 300])
@pytest.mark.parametrize("sample", [b"", bytes(64), bytes(range(200))])
def test_a_drop_is_told_with_its_words_and_at_most_64_octets(sample: bytes, why: str):
    reason, count, kept, words = talk.parse_dropped(talk.dropped(Reason.PAYLOAD, 7, sample, why))
    assert (reason, count, kept) == (Reason.PAYLOAD, 7, sample[:64])
    assert words == why.replace("\udcff", "\\udcff")
