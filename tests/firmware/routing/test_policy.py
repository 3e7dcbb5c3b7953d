"""Which row of the policy a message meets: each kind of match alone, together, and what a row makes of it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.describe import read
from drivers.contract import Can
from drivers.message import Area, Ego, Position, Shape
from firmware.config.tables import Tables
from firmware.routing.policy import CompiledRow, Policy, Rate
from firmware.topics import Topics, TypeRow
from tests.firmware.doubles import INGOLSTADT, pdu_of

TOPICS = Topics()
MUNICH = Position(481371540, 115761240)
HERE = Area(Shape.CIRCLE, INGOLSTADT, 1000)
THERE = Area(Shape.CIRCLE, MUNICH, 1000)


class Place:
    """firmware.routing.policy.Surroundings, as the test says."""

    def __init__(self) -> None:
        self.up: set[str] = set()
        self.abilities = Can(0)
        self.heard: dict[str, int] = {}
        self.asked: list[tuple[str, float, int | None]] = []
        self.position: Position | None = INGOLSTADT

    def is_up(self, interface: str) -> bool:
        return interface in self.up

    def has_up(self, ability: Can) -> bool:
        return ability in self.abilities

    def neighbours(self, interface: str, within_s: float, rssi_dbm: int | None, enough: int) -> int:
        self.asked.append((interface, within_s, rssi_dbm))
        return self.heard.get(interface, 0)

    def ego(self) -> Ego:
        return Ego(0, self.position or Position(), self.position is not None)


class Bench:
    def __init__(self, *rows: dict[str, object]) -> None:
        self.place = Place()
        table = {"policy": [{"name": f"row {at}", **row} for at, row in enumerate(rows)]}
        self.policy = Policy(read(Tables, table, "test").policy, TOPICS, self.place)

    def row(
        self,
        number: int = 2,
        pdu: bytes | None = None,
        btp_port: int | None = None,
        traffic_class: int = 2,
        area: Area | None = None,
    ) -> CompiledRow:
        kind = TOPICS.by_number[number]
        port = kind.btp_port or 0 if btp_port is None else btp_port
        return self.policy.choose(kind, pdu_of(number) if pdu is None else pdu, port, traffic_class, area)

    def meets(self, *args: object, **kwargs: object) -> bool:
        return self.row(*args, **kwargs).name == "row 0"


def matching(**match: object) -> Bench:
    return Bench({"match": match})


def test_without_a_policy_all_go_everywhere_with_what_their_type_is_worth() -> None:
    bench = Bench()
    row = bench.row(1)
    assert (row.name, row.interfaces, row.fallback, row.rate) == ("default", ("*",), (), None)
    assert row.plans[TOPICS.by_number[1].row] == (10.0, 0, 1)
    assert row.plans[TOPICS.by_number[2].row] == (1.0, 2, 2)


def test_a_row_without_a_match_takes_all() -> None:
    bench = Bench({})
    assert all(bench.meets(number) for number in range(256))


def test_a_type_is_met_by_its_name() -> None:
    bench = matching(type=["denm", "cam"])
    assert [bench.meets(number) for number in (1, 2, 3, 200)] == [True, True, False, False]


def test_a_name_of_two_ids_means_both() -> None:
    bench = matching(type=["vam"])
    assert bench.meets(16)
    assert bench.meets(102)


def test_a_station_is_met_by_its_id() -> None:
    bench = matching(station=[1337, 4294967295])
    assert bench.meets(pdu=pdu_of(2, 1337))
    assert bench.meets(pdu=pdu_of(2, 4294967295))
    assert not bench.meets(pdu=pdu_of(2, 1338))


@pytest.mark.parametrize("size", range(6))
def test_a_pdu_that_holds_no_station_is_nobodys(size: int) -> None:
    assert not matching(station=[0, 1337]).meets(pdu=bytes(size))


@pytest.mark.parametrize(
    ("span", "sizes"),
    [
        ({"min": 10}, [False, True, True]),
        ({"max": 10}, [True, True, False]),
        ({"min": 10, "max": 10}, [False, True, False]),
    ],
)
def test_a_size_is_met_with_its_limits_included(span: dict[str, int], sizes: list[bool]) -> None:
    bench = matching(size=span)
    assert [bench.meets(pdu=bytes(size)) for size in (9, 10, 11)] == sizes


def test_a_btp_port_is_met() -> None:
    bench = matching(btp_port=[2001, 3000])
    assert bench.meets(btp_port=3000)
    assert not bench.meets(btp_port=3001)


def test_a_traffic_class_is_met() -> None:
    bench = matching(traffic_class=[0, 255])
    assert bench.meets(traffic_class=255)
    assert not bench.meets(traffic_class=2)


@pytest.mark.parametrize(
    ("wanted", "met"),
    [
        ("none", [True, False, False]),
        ("any", [False, True, True]),
        ("inside", [False, True, False]),
        ("outside", [False, False, True]),
        ("", [True, True, True]),
    ],
)
def test_an_area_is_met(wanted: str, met: list[bool]) -> None:
    bench = matching(area=wanted)
    assert [bench.meets(area=area) for area in (None, HERE, THERE)] == met


@pytest.mark.parametrize("wanted", ["inside", "outside"])
def test_a_station_that_does_not_know_its_place_is_neither_inside_nor_outside(wanted: str) -> None:
    bench = matching(area=wanted)
    bench.place.position = None
    assert not bench.meets(area=HERE)
    assert not bench.meets(area=THERE)


def test_payload_octets_are_met() -> None:
    bench = matching(payload=[{"offset": 6, "value": "626f"}])
    assert bench.meets(pdu=pdu_of(2, body=b"body"))
    assert not bench.meets(pdu=pdu_of(2, body=b"Body"))


def test_only_the_bits_of_the_mask_are_compared() -> None:
    bench = matching(payload=[{"offset": 6, "value": "a0ff", "mask": "f000"}])
    assert bench.meets(pdu=pdu_of(2, body=b"\xaf\x00"))
    assert not bench.meets(pdu=pdu_of(2, body=b"\xbf\xff"))


@pytest.mark.parametrize("body", [b"", b"\xa0"])
def test_a_pdu_that_ends_before_the_octets_does_not_have_them(body: bytes) -> None:
    assert not matching(payload=[{"offset": 6, "value": "a000"}]).meets(pdu=pdu_of(2, body=body))
    assert not matching(payload=[{"offset": 6, "value": "0000", "mask": "0000"}]).meets(pdu=pdu_of(2, body=body))


def test_several_payload_matches_must_all_hold() -> None:
    bench = matching(payload=[{"offset": 0, "value": "02"}, {"offset": 1, "value": "01"}])
    assert bench.meets(1)
    assert not bench.meets(2)


@given(st.binary(max_size=40), st.integers(0, 40), st.binary(min_size=1, max_size=6), st.data())
def test_a_mask_means_the_same_bit_by_bit(pdu: bytes, offset: int, value: bytes, data: st.DataObject) -> None:
    mask = data.draw(st.binary(min_size=len(value), max_size=len(value)))
    found = pdu[offset : offset + len(value)]
    expected = len(found) == len(value) and all(f & m == v & m for f, v, m in zip(found, value, mask, strict=True))
    bench = matching(payload=[{"offset": offset, "value": value.hex(), "mask": mask.hex()}])
    assert bench.meets(pdu=pdu) is expected


def test_links_that_are_up_and_down_are_met_as_they_are_now() -> None:
    bench = matching(link_up=["mqtt"], link_down=["g5"])
    assert not bench.meets()
    bench.place.up = {"mqtt"}
    assert bench.meets()
    bench.place.up = {"mqtt", "g5"}
    assert not bench.meets()


@pytest.mark.parametrize("wanted", [True, False])
def test_a_bearer_is_met_as_it_is_now(wanted: bool) -> None:
    bench = matching(bearer=wanted)
    assert bench.meets() is not wanted
    bench.place.abilities = Can.BEARER | Can.RECEIVE
    assert bench.meets() is wanted


def test_neighbours_are_met_from_their_count_on() -> None:
    bench = matching(neighbours={"interface": "g5", "within_s": 3, "count": 2, "rssi_dbm": -80})
    for heard, met in ((0, False), (1, False), (2, True), (3, True)):
        bench.place.heard = {"g5": heard, "other": 9}
        assert bench.meets() is met
    assert bench.place.asked[-1] == ("g5", 3.0, -80)


def test_no_neighbours_are_met_below_their_count() -> None:
    bench = matching(no_neighbours={"interface": "g5"})
    assert bench.meets()
    assert bench.place.asked == [("g5", 5.0, None)]
    bench.place.heard = {"g5": 1}
    assert not bench.meets()


def test_the_own_position_is_met_inside_its_circle_only() -> None:
    bench = matching(position={"latitude": 48.7668616, "longitude": 11.432068, "radius_m": 100})
    assert bench.meets()
    bench.place.position = MUNICH
    assert not bench.meets()
    bench.place.position = None
    assert not bench.meets()


EVERYTHING = {
    "type": ["cam"],
    "station": [1337],
    "size": {"min": 10, "max": 10},
    "btp_port": [2001],
    "traffic_class": [2],
    "area": "inside",
    "payload": [{"offset": 6, "value": "62"}],
    "link_up": ["mqtt"],
    "link_down": ["uart"],
    "bearer": True,
    "neighbours": {"interface": "g5"},
    "no_neighbours": {"interface": "mqtt"},
    "position": {"latitude": 48.7668616, "longitude": 11.432068, "radius_m": 100},
}


def everything() -> Bench:
    bench = matching(**EVERYTHING)
    bench.place.up = {"mqtt"}
    bench.place.abilities = Can.BEARER
    bench.place.heard = {"g5": 1}
    return bench


def test_all_kinds_of_match_together_are_met_when_all_hold() -> None:
    assert everything().meets(area=HERE)


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ({}, {"number": 1, "btp_port": 2001}),
        ({}, {"pdu": pdu_of(2, 1)}),
        ({}, {"pdu": pdu_of(2, body=b"bodyy")}),
        ({}, {"btp_port": 2002}),
        ({}, {"traffic_class": 3}),
        ({}, {"area": None}),
        ({}, {"area": THERE}),
        ({}, {"pdu": pdu_of(2, body=b"Body")}),
        ({"up": set()}, {}),
        ({"up": {"mqtt", "uart"}}, {}),
        ({"abilities": Can.RECEIVE}, {}),
        ({"heard": {}}, {}),
        ({"heard": {"g5": 1, "mqtt": 1}}, {}),
        ({"position": MUNICH}, {"area": THERE}),
    ],
)
def test_one_match_that_does_not_hold_is_enough_to_pass_the_row_by(
    place: dict[str, object], message: dict[str, object]
) -> None:
    bench = everything()
    for name, value in place.items():
        setattr(bench.place, name, value)
    assert not bench.meets(**{"area": HERE, **message})


def test_the_first_row_that_applies_wins() -> None:
    bench = Bench({"match": {"type": ["denm"]}}, {"match": {"size": {"min": 100}}}, {"match": {"type": ["cam"]}}, {})
    assert bench.row(1).name == "row 0"
    assert bench.row(1, pdu=bytes(200)).name == "row 0"
    assert bench.row(2, pdu=bytes(200)).name == "row 1"
    assert bench.row(2).name == "row 2"
    assert bench.row(5).name == "row 3"


def test_what_no_row_takes_meets_the_default() -> None:
    bench = Bench({"match": {"type": ["denm"]}}, {"match": {"size": {"min": 100}}})
    assert bench.row(2).name == "default"


def test_each_row_counts_what_it_took() -> None:
    bench = Bench({"match": {"type": ["denm"]}}, {"match": {"size": {"min": 100}}})
    for number in (1, 1, 2):
        bench.row(number)
    assert bench.policy.status() == [
        {"name": "row 0", "matched": 2},
        {"name": "row 1", "matched": 0},
        {"name": "default", "matched": 1},
    ]


def test_a_row_without_a_name_is_called_by_its_place() -> None:
    bench = Bench({"name": ""})
    assert bench.row().name == "policy[0]"


def test_a_row_changes_what_it_says_and_leaves_the_rest_to_the_type() -> None:
    row = Bench({"priority": 5, "traffic_class": 7}).row(1)
    assert row.plans[TOPICS.by_number[1].row] == (10.0, 5, 7)
    row = Bench({"lifetime_s": 0.25}).row(1)
    assert row.plans[TOPICS.by_number[1].row] == (0.25, 0, 1)
    row = Bench({"lifetime_s": 0.0, "priority": 0, "traffic_class": 0}).row(2)
    assert row.plans[TOPICS.by_number[2].row] == (0.0, 0, 0)


def test_a_bucket_lets_a_seconds_worth_through_and_then_its_rate() -> None:
    rate = Rate(10.0)
    assert [rate.allows(1000.0) for _ in range(12)] == [True] * 10 + [False] * 2
    assert rate.allows(1000.1)
    assert not rate.allows(1000.1)
    assert [rate.allows(1000.6) for _ in range(6)] == [True] * 5 + [False]


def test_a_bucket_never_holds_more_than_a_second() -> None:
    rate = Rate(2.0)
    rate.allows(0.0)
    assert [rate.allows(3600.0) for _ in range(3)] == [True, True, False]


def test_a_bucket_of_less_than_one_a_second_lets_one_through_and_waits() -> None:
    rate = Rate(0.5)
    assert rate.allows(1000.0)
    assert not rate.allows(1001.0)
    assert rate.allows(1002.0)
    assert not rate.allows(1003.9)


def test_what_a_bucket_refuses_does_not_drain_it() -> None:
    rate = Rate(1.0)
    rate.allows(0.0)
    refused = [rate.allows(0.0 + step / 100) for step in range(1, 100)]
    assert not any(refused)
    assert rate.allows(1.001)


@given(st.floats(0.01, 1000), st.lists(st.floats(0, 2), min_size=1, max_size=60))
def test_a_bucket_never_lets_more_through_than_its_rate_and_one_second(per_s: float, gaps: list[float]) -> None:
    rate, now, passed = Rate(per_s), 0.0, 0
    for gap in gaps:
        now += gap
        passed += rate.allows(now)
    assert passed <= per_s * (now - gaps[0]) + max(1.0, per_s) + 1e-6


def test_type_that_is_added_has_its_own_plan_and_the_rows_for_it() -> None:
    topics = Topics()
    table = {"policy": [{"match": {"type": ["hello"]}, "interfaces": ["g5"]}, {"match": {"type": ["cam"]}}]}
    policy = Policy(read(Tables, table, "test").policy, topics, Place())
    for number, name, priority in ((200, "first", 5), (201, "hello", 1)):
        kind = topics.add(TypeRow(number, name, 3000, 3000, priority=priority))
        assert kind is not None
        policy.add_kind(kind)
        row = policy.choose(kind, pdu_of(number), 3000, 2, None)
        assert row.plans[kind.row].priority == priority
        assert row.interfaces == (("g5",) if name == "hello" else ("*",))
