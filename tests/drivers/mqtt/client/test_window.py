"""Window of requests to a broker: order, limits, and requests that are not sent."""

import pytest

from drivers.mqtt.client.window import Accepted, Window
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.profile import Publication

ROOM = Accepted()


class Bench:
    """Window with a client that accepts requests while it is free."""

    def __init__(self, size: int = 20) -> None:
        self.said: list[bytes] = []
        self.published: list[Publication] = []
        self.is_free = True
        self.window = Window(self._publish, lambda: self.is_free, self.said.append, size)

    def _publish(self, publication: Publication, now: float) -> int:
        self.published.append(publication)
        return len(self.published)

    def add(self, number: int, deadline: float = 10.0, count: int = 1, **how: object) -> None:
        many = [Publication(f"t{number}", b"x", 1, False, None)._replace(**how) for _ in range(count)]
        self.window.add(number, deadline, many, now=0.0)

    @property
    def topics(self) -> list[str]:
        return [one.topic for one in self.published]

    @property
    def outcomes(self) -> dict[int, Reason | None]:
        return {number: reason for number, reason, _ in map(talk.parse_sent, self.said)}


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.window.open(ROOM, "broker", None, now=0.0)
    return made


def test_what_a_broker_does_not_read_is_not_handed_out(bench: Bench) -> None:
    bench.add(1)
    bench.is_free = False
    bench.add(2)
    bench.add(3, deadline=0.5)
    bench.window.expire(0.5, "")
    bench.is_free = True
    bench.window.flush(0.6)
    assert (bench.topics, bench.outcomes) == (["t1", "t2"], {3: Reason.EXPIRED})


def test_what_the_session_says_of_itself_goes_first_and_takes_a_place() -> None:
    bench = Bench()
    bench.add(1)
    bench.add(2)
    own = Publication("status", b"here", 1, False, None)
    bench.window.open(ROOM._replace(receive_maximum=2), "broker", own, now=0.0)
    assert bench.topics == ["status", "t1"]
    bench.window.published_one(1, "", 0.1)
    assert bench.topics == ["status", "t1", "t2"]


def test_a_good_bye_for_which_the_broker_has_no_place_needs_no_acknowledgement() -> None:
    bench = Bench()
    bench.window.open(ROOM._replace(receive_maximum=1), "broker", None, now=0.0)
    good_bye = Publication("status", b"bye", 1, False, None)
    bench.add(1)
    bench.window.add_own(good_bye, 0.1)
    assert [(one.topic, one.qos) for one in bench.published] == [("t1", 1), ("status", 0)]
    bench.window.published_one(1, "", 0.2)
    bench.window.add_own(good_bye, 0.3)
    assert bench.published[-1].qos == 0  # the first is not written yet
    for token in (2, 3):
        bench.window.published_one(token, "", 0.4)
    bench.window.add_own(good_bye, 0.5)
    assert bench.published[-1].qos == 1


@pytest.mark.parametrize(
    ("lifetime", "expiry_s", "retain", "expected"),
    [
        (0.2, None, False, 1),
        (9.9, None, False, 9),
        (9.0, None, False, 9),
        (9.5, 3, False, 3),
        (1.5, 30, False, 30),
        (1.5, None, True, None),
        (1.5, 600, True, 600),
    ],
)
def test_a_broker_keeps_it_for_its_lifetime_unless_the_profile_says_otherwise(
    bench: Bench, lifetime: float, expiry_s: int | None, retain: bool, expected: int | None
) -> None:
    bench.add(1, lifetime, retain=retain, expiry_s=expiry_s)
    assert bench.published[0].expiry_s == expected


def test_what_is_answered_does_not_pile_up_behind_what_lives(bench: Bench) -> None:
    bench.is_free = False
    bench.add(1, deadline=1000.0)
    for number in range(2, 200):
        bench.add(number, deadline=1.0)
        bench.window.expire(1.0, "")
        assert len(bench.window._waiting) <= 2
    bench.is_free = True
    bench.window.flush(2.0)
    assert bench.topics == ["t1"]


def test_what_failed_in_part_does_not_wait_for_the_rest() -> None:
    bench = Bench(size=1)
    bench.window.open(ROOM, "broker", None, now=0.0)
    for number in range(1, 100):
        bench.add(number, deadline=1000.0, count=3)
        bench.window.published_one(number, "refuses it", 0.1)
    assert (len(bench.published), len(bench.window._waiting)) == (99, 0)
