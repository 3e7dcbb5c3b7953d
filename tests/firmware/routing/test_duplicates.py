"""Pairs of copies over several interfaces: the k-th of one with the k-th of another, inside a window."""

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.message import NO_RX_INFO, Indication
from drivers.reason import Reason
from firmware.routing.drops import Drops
from firmware.routing.duplicates import Duplicates
from firmware.topics import Topics
from tests.firmware.doubles import CAM_PDU, pdu_of

TOPICS = Topics()
CAM = TOPICS.by_number[2]


class Bench:
    def __init__(self, window_s: float = 2.0, **limits: int) -> None:
        self.drops = Drops()
        self.stage = Duplicates(window_s, self.drops, TOPICS, **limits)
        self.now = 1000.0

    def passes(self, interface: str, pdu: bytes = CAM_PDU) -> bool:
        indication = Indication(CAM, pdu, interface, 0, self.now, NO_RX_INFO)
        passed = self.stage([indication])
        assert passed in ([], [indication])
        return bool(passed)

    def run(self, interfaces: str) -> str:
        """The letters of those copies that pass."""
        return "".join(letter for letter in interfaces if self.passes(letter))


@pytest.mark.parametrize(
    ("arrivals", "passed"),
    [
        ("A", "A"),
        ("AB", "A"),
        ("ABC", "A"),
        ("AA", "AA"),
        ("AAAA", "AAAA"),
        ("AABB", "AA"),
        ("ABAB", "AA"),
        ("ABBA", "AB"),  # the second of B is first, the second of A its copy
        ("AABBB", "AAB"),
        ("AABBBA", "AAB"),
        ("ABCABC", "AA"),
        ("ABCCBA", "AC"),
        ("AAABCBCBC", "AAA"),
    ],
)
def test_the_kth_copy_of_one_interface_pairs_with_the_kth_of_another(arrivals: str, passed: str) -> None:
    assert Bench().run(arrivals) == passed


@given(st.text("ABC", max_size=40))
def test_as_many_copies_pass_as_the_busiest_interface_has_brought(arrivals: str) -> None:
    bench = Bench()
    passed = bench.run(arrivals)
    assert len(passed) == max((arrivals.count(letter) for letter in "ABC"), default=0)
    assert bench.stage.suppressed == len(arrivals) - len(passed)


def test_repeats_on_one_interface_are_never_suppressed() -> None:
    bench = Bench()
    assert all(bench.passes("A") for _ in range(1000))
    assert bench.stage.suppressed == 0


def test_different_octets_are_different_messages() -> None:
    bench = Bench()
    assert bench.passes("A", b"\x02\x02aaaa1")
    assert bench.passes("B", b"\x02\x02aaaa2")


def test_a_copy_inside_the_window_is_suppressed_at_its_very_end() -> None:
    bench = Bench(window_s=2.0)
    bench.passes("A")
    bench.now += 2.0
    assert not bench.passes("B")


def test_a_copy_after_the_window_passes_and_opens_a_new_one() -> None:
    bench = Bench(window_s=2.0)
    bench.passes("A")
    bench.now += 2.001
    assert bench.passes("B")
    assert not bench.passes("A")


def test_the_window_runs_from_each_delivery_not_from_the_first() -> None:
    bench = Bench(window_s=2.0)
    bench.passes("A")
    bench.now += 1.5
    bench.passes("A")
    bench.now += 1.0  # the first is forgotten, the second is not
    assert not bench.passes("B")
    assert bench.passes("B")


def test_a_suppressed_copy_does_not_lengthen_the_window() -> None:
    bench = Bench(window_s=2.0)
    bench.passes("A")
    bench.now += 1.9
    assert not bench.passes("B")
    bench.now += 0.2
    assert bench.passes("C")


def test_each_suppressed_copy_is_counted_where_it_came_with_a_sample() -> None:
    bench = Bench()
    bench.run("ABB")
    assert bench.drops.total("B", Reason.DUPLICATE) == 1
    assert bench.drops.total("A", Reason.DUPLICATE) == 0
    (said,) = bench.drops.status()
    assert said["sample"] == CAM_PDU.hex()


def test_who_was_first_and_by_how_much_is_remembered() -> None:
    bench = Bench()
    for lead in (0.010, 0.030):
        bench.passes("A")
        bench.now += lead
        bench.passes("B")
        bench.now += 10
    bench.passes("B")
    bench.now += 0.5
    bench.passes("A")
    said = bench.stage.status()
    assert said["first"] == {"A": 2, "B": 1}
    assert said["lead_ms"] == {"A": 20.0, "B": 500.0}
    assert said["suppressed"] == 3


def test_a_message_that_only_one_interface_brings_makes_nobody_first() -> None:
    bench = Bench()
    bench.run("AAAA")
    assert bench.stage.status()["first"] == {}


def test_more_than_the_capacity_forgets_the_oldest() -> None:
    bench = Bench(capacity=3)
    for number in range(4):
        bench.passes("A", pdu_of(number))
    assert not bench.passes("B", pdu_of(2))
    assert not bench.passes("B", pdu_of(3))
    assert bench.passes("B", pdu_of(0))


@pytest.mark.parametrize("is_one_pdu", [False, True])
def test_a_flood_takes_no_more_room_than_the_capacity(is_one_pdu: bool) -> None:
    bench = Bench(capacity=100)
    for number in range(20_000):
        bench.passes("A", pdu_of(2, 0 if is_one_pdu else number))
    remembered = bench.stage._deliveries
    assert sum(len(one) if isinstance(one, list) else 1 for one in remembered.values()) <= 100
    assert len(bench.stage._order) <= 100


def test_nothing_is_remembered_when_the_window_is_over() -> None:
    bench = Bench()
    for number, letter in product(range(50), "AB"):
        bench.passes(letter, pdu_of(2, number))
    bench.now += 3
    bench.passes("A")
    assert list(bench.stage._deliveries) == [hash(CAM_PDU)]


def test_a_copy_that_comes_just_after_the_window_has_no_counterpart_though_nothing_was_swept_yet() -> None:
    bench = Bench(window_s=2.0)
    bench.passes("A")
    bench.now += 0.5
    bench.passes("A")
    bench.now += 1.501
    assert not bench.passes("B")  # of the second
    assert bench.stage.status()["lead_ms"] == {"A": 1501.0}


def test_a_message_that_only_one_way_brings_is_known_when_its_window_has_passed() -> None:
    bench = Bench(window_s=2.0)
    bench.run("AA")
    bench.now += 2.0
    bench.stage.expire(bench.now)
    assert bench.stage.status()["paths"] == []
    bench.now += 0.001
    bench.stage.expire(bench.now)
    (path,) = bench.stage.status()["paths"]
    assert path == {"station": 1337, "type": "cam", "first": {}, "lead_ms": {}, "alone": {"A": 2}}


def test_who_was_first_is_known_for_each_station_and_type() -> None:
    bench = Bench()
    cam, denm = pdu_of(2, station=7), pdu_of(1, station=7)
    for lead in (0.010, 0.020):
        bench.passes("g5", cam)
        bench.now += lead
        bench.passes("v2n", cam)
        bench.now += 3
    bench.passes("v2n", denm)
    bench.now += 0.4
    bench.passes("g5", denm)
    bench.passes("v2n", pdu_of(2, station=8))
    bench.now += 3
    bench.stage.expire(bench.now)
    assert bench.stage.status()["paths"] == [
        {"station": 7, "type": "denm", "first": {"v2n": 1}, "lead_ms": {"v2n": 400.0}, "alone": {}},
        {"station": 7, "type": "cam", "first": {"g5": 2}, "lead_ms": {"g5": 15.0}, "alone": {}},
        {"station": 8, "type": "cam", "first": {}, "lead_ms": {}, "alone": {"v2n": 1}},
    ]


@given(st.text("AB", max_size=60))
def test_every_copy_is_counted_once_paired_or_alone(arrivals: str) -> None:
    bench = Bench()
    bench.run(arrivals)
    bench.now += 3
    bench.stage.expire(bench.now)
    paths = bench.stage.status()["paths"]
    paired = sum(sum(path["first"].values()) for path in paths)
    alone = sum(sum(path["alone"].values()) for path in paths)
    assert 2 * paired + alone == len(arrivals)


def test_a_flood_of_one_pdu_costs_each_copy_no_walk_over_all_before() -> None:
    class Counted(str):
        """An interface's name that counts how often it is compared."""

        __slots__ = ()
        compared = 0

        def __eq__(self, other: object) -> bool:
            Counted.compared += 1
            return str(self) == other

        def __ne__(self, other: object) -> bool:
            return not self == other

        __hash__ = str.__hash__

    bench = Bench()
    for _ in range(1000):
        bench.passes(Counted("A"))
    assert Counted.compared < 30_000  # a walk would be half a million
