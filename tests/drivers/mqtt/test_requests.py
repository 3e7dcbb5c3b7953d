"""Requests on their way through the session: published, acknowledged, again after an outage, expired."""

from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from drivers.mqtt.client.session import Phase
from drivers.reason import Reason
from drivers.wire.v2n.profile import Profile, Publication
from tests.drivers.mqtt.model import CAM, URL, Bench, Tiles, tiles
from tests.said import tells


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
    bench = Bench(max_in_flight=3).accept()
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
    bench = Bench(max_in_flight=2)
    for number in range(6):
        bench.send(number)
    assert bench.outcomes == {4: Reason.QUEUE_FULL, 5: Reason.QUEUE_FULL}


def test_request_that_cannot_leave_expires_at_its_deadline_with_the_reason():
    bench = Bench()
    why = "no route to it"
    bench.session.failed(why, bench.now)
    bench.send(1, lifetime=3.0)
    bench.run(2.9)
    assert bench.outcomes == {}
    bench.run(0.1)
    assert bench.sent == [(1, Reason.EXPIRED, f"{URL}: {why}")]
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
    bench = Bench(max_in_flight=1).accept()
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


def test_message_that_is_too_long_for_the_broker_fails_with_its_limit():
    bench = Bench().accept(maximum_packet=100)
    bench.send(1, pdu=CAM + bytes(100))
    bench.send(2)
    ((number, reason, why),) = bench.sent
    assert (number, reason) == (1, Reason.SEND_FAILED)
    assert tells(why, f"{URL}: ", "packet", "100 octets")
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
    bench = Bench(bearer="modem" * has_bearer, max_in_flight=3)
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
