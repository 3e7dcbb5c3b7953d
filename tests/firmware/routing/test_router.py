"""Router: interfaces of a message; every refusal is reported once and counted."""

from collections.abc import Iterator
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract import Can
from drivers.message import NO_RX_INFO, Indication, Outcome
from drivers.reason import Reason
from firmware.routing.options import NOTHING_ASKED, Parsed, parse
from firmware.routing.router import BURST
from firmware.topics import Topics
from tests.firmware.doubles import CAM_PDU, pdu_of
from tests.firmware.routing.router_bench import Bench
from tests.virtual import VirtualLoop


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


def test_without_a_policy_a_message_leaves_by_every_interface(bench: Bench) -> None:
    bench.request()
    assert bench.sent_by("g5") == bench.sent_by("mqtt") == [1]


def test_the_users_are_told_that_it_is_accepted_and_then_by_each_interface(bench: Bench) -> None:
    bench.request()
    told = [(confirm.outcome, confirm.interface, targets) for confirm, targets in bench.confirms]
    assert told == [
        (Outcome.ACCEPTED, "", ["g5", "mqtt"]),
        (Outcome.SENT, "g5", []),
        (Outcome.SENT, "mqtt", []),
    ]


def test_nobody_is_told_where_nobody_listens(bench: Bench) -> None:
    bench.router.set_listeners([], [])
    bench.request()
    bench.request(200)
    assert bench.confirms == []
    assert (bench.router.requests, bench.router.accepted, bench.refused) == (2, 1, 1)


def test_an_interface_that_only_receives_is_left_out(bench: Bench) -> None:
    bench.add("gnss", Can.RECEIVE)
    bench.request()
    assert bench.confirms[0][1] == ["g5", "mqtt"]


def test_a_row_names_the_interfaces(bench: Bench) -> None:
    bench.policy({"interfaces": ["mqtt"]})
    bench.request()
    assert (bench.sent_by("g5"), bench.sent_by("mqtt")) == ([], [1])


def test_an_interface_that_is_named_twice_sends_once(bench: Bench) -> None:
    bench.policy({"interfaces": ["g5", "g5"]})
    bench.request()
    assert bench.sent_by("g5") == [1]


def test_what_waits_for_a_link_alone_is_accepted_and_waits(bench: Bench) -> None:
    bench.policy({"interfaces": ["g5"]})
    bench.link("g5", False)
    bench.request()
    assert bench.router.accepted == 1
    assert bench.sent_by("g5") == []
    bench.link("g5", True)
    assert bench.sent_by("g5") == [1]


def test_of_several_interfaces_only_those_with_a_link_are_used(bench: Bench) -> None:
    bench.link("g5", False)
    bench.request()
    assert bench.confirms[0][1] == ["mqtt"]
    bench.link("g5", True)
    bench.request()
    assert bench.sent_by("g5") == [2]


def test_the_fall_back_is_used_while_none_of_the_named_has_its_link_up(bench: Bench) -> None:
    bench.policy({"interfaces": ["g5"], "fallback": ["mqtt"]})
    bench.request()
    bench.link("g5", False)
    bench.request()
    bench.link("g5", True)
    bench.request()
    assert (bench.sent_by("g5"), bench.sent_by("mqtt")) == ([1, 3], [2])


def test_a_fall_back_that_is_down_as_well_lets_it_wait_at_the_named(bench: Bench) -> None:
    bench.policy({"interfaces": ["g5"], "fallback": ["mqtt"]})
    bench.link("g5", False)
    bench.link("mqtt", False)
    bench.request()
    assert bench.confirms[0][1] == ["g5"]


def test_mqtt_when_no_neighbour_was_heard_on_its_g5(bench: Bench) -> None:
    near = {"match": {"neighbours": {"interface": "g5", "within_s": 5}}, "interfaces": ["g5"]}
    bench.policy(near, {"interfaces": ["mqtt"]})
    bench.request()
    bench.router.interfaces["g5"].heard(b"abcdef", -70)
    bench.request()
    bench.loop.run_for(6)
    bench.request()
    assert (bench.sent_by("g5"), bench.sent_by("mqtt")) == ([2], [1, 3])


def test_a_policy_that_is_exchanged_holds_from_the_next_message(bench: Bench) -> None:
    bench.policy({"interfaces": ["g5"]})
    bench.request()
    bench.policy({"interfaces": ["mqtt"]})
    bench.request()
    assert (bench.sent_by("g5"), bench.sent_by("mqtt")) == ([1], [2])


def test_an_interface_that_is_added_later_is_used(bench: Bench) -> None:
    bench.request()
    bench.add("uart")
    bench.request()
    assert bench.sent_by("uart") == [2]


def test_priority_lifetime_and_traffic_class_are_those_of_the_row(bench: Bench) -> None:
    bench.policy({"priority": 6, "lifetime_s": 4.0, "traffic_class": 9})
    bench.request()
    (request,) = bench.drivers["g5"].sent
    assert (request.priority, request.deadline - request.accepted, request.traffic_class) == (6, 4.0, 9)


def test_what_the_user_asks_goes_before_what_the_row_says(bench: Bench) -> None:
    bench.policy({"priority": 6, "lifetime_s": 4.0, "traffic_class": 9, "interfaces": ["mqtt"]})
    asked = parse(
        b'{"label": "mine", "interfaces": ["g5"], "btp_port": 3000, "traffic_class": 1, "priority": 0,'
        b' "lifetime_s": 0.5, "hop_limit": 4,'
        b' "area": {"shape": "circle", "latitude": 1, "longitude": 2, "distance_a": 3}}'
    )
    bench.request(asked=asked)
    (request,) = bench.drivers["g5"].sent
    assert bench.sent_by("mqtt") == []
    assert (request.label, request.btp_port, request.traffic_class, request.priority) == ("mine", 3000, 1, 0)
    assert (request.deadline - request.accepted, request.hop_limit) == (0.5, 4)
    assert request.area == asked.area


def test_what_the_user_leaves_open_stays_as_the_row_says(bench: Bench) -> None:
    bench.policy({"priority": 6, "lifetime_s": 4.0, "traffic_class": 9})
    bench.request(asked=parse(b'{"label": "mine"}'))
    (request,) = bench.drivers["g5"].sent
    assert (request.priority, request.deadline - request.accepted, request.traffic_class) == (6, 4.0, 9)
    assert (request.hop_limit, request.area) == (1, None)


def test_a_port_of_the_user_lets_a_type_without_one_leave(bench: Bench) -> None:
    bench.request(200, asked=parse(b'{"btp_port": 3000}'))
    assert bench.drivers["g5"].sent[0].btp_port == 3000


def test_the_port_and_the_class_that_the_user_asks_for_are_those_the_policy_sees(bench: Bench) -> None:
    bench.policy({"match": {"btp_port": [3000], "traffic_class": [7]}, "interfaces": ["mqtt"]}, {"interfaces": ["g5"]})
    bench.request(asked=parse(b'{"btp_port": 3000, "traffic_class": 7}'))
    bench.request(asked=parse(b'{"btp_port": 3000}'))
    assert (bench.sent_by("mqtt"), bench.sent_by("g5")) == ([1], [2])


def test_a_user_who_names_one_interface_wrongly_is_told_and_nothing_is_sent(bench: Bench) -> None:
    bench.request(asked=parse(b'{"interfaces": ["g5", "typo"]}'))
    assert bench.refusals() == [Reason.NO_INTERFACE]
    assert "'typo'" in bench.confirms[0][0].detail
    assert bench.sent_by("g5") == []


NAMES_NOBODY = parse(b'{"interfaces": ["nobody"], "label": "mine"}')
NAMES_A_RECEIVER = parse(b'{"interfaces": ["gnss"], "label": "mine"}')


@pytest.mark.parametrize(
    ("rows", "number", "asked", "reason"),
    [
        ([], 200, NOTHING_ASKED, Reason.UNKNOWN_TYPE),
        ([], 201, parse(b'{"label": "mine"}'), Reason.UNKNOWN_TYPE),
        ([{"interfaces": []}], 2, NOTHING_ASKED, Reason.POLICY),
        ([{"interfaces": []}], 2, parse(b'{"label": "mine"}'), Reason.POLICY),
        ([{"interfaces": ["gnss"]}], 2, NOTHING_ASKED, Reason.NO_INTERFACE),
        ([], 2, NAMES_NOBODY, Reason.NO_INTERFACE),
        ([], 2, NAMES_A_RECEIVER, Reason.NO_INTERFACE),
        ([{"interfaces": []}], 2, NAMES_NOBODY, Reason.NO_INTERFACE),
    ],
)
def test_each_refusal_is_told_once_with_its_reason_and_counted(
    bench: Bench, rows: list[dict[str, object]], number: int, asked: Parsed, reason: Reason
) -> None:
    bench.add("gnss", Can.RECEIVE)
    bench.policy(*rows)
    bench.request(number, asked=asked)
    assert bench.refusals() == [reason]
    assert len(bench.confirms) == 1
    assert bench.confirms[0][0].request.label == asked.options.label
    assert bench.drops.total("from_users", reason) == bench.refused == 1
    assert (bench.router.requests, bench.router.accepted) == (1, 0)
    assert bench.sent_by("g5") == bench.sent_by("mqtt") == []


@pytest.mark.parametrize(("number", "reason"), [(8, Reason.NO_PORT), (15, Reason.UNKNOWN_TYPE)])
def test_what_the_legacy_profile_does_not_send_is_refused(number: int, reason: Reason) -> None:
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop, profile="legacy")
        bench.request(number)
        assert bench.refusals() == [reason]


def test_more_than_the_rows_rate_is_refused_until_there_is_room_again(bench: Bench) -> None:
    bench.policy({"rate_per_s": 2})
    for _ in range(5):
        bench.request()
    assert bench.refusals() == [Reason.RATE_LIMIT] * 3
    bench.loop.run_for(1.0)
    bench.request()
    assert bench.router.accepted == 3


def test_the_rate_of_one_row_is_not_that_of_another(bench: Bench) -> None:
    bench.policy({"match": {"type": ["cam"]}, "rate_per_s": 1}, {})
    bench.request(2)
    bench.request(2)
    bench.request(1, pdu_of(1))
    assert (bench.router.accepted, bench.refusals()) == (2, [Reason.RATE_LIMIT])


def test_what_is_no_message_is_counted_and_told_too(bench: Bench) -> None:
    bench.router.refuse_message(Reason.BAD_ENVELOPE, b"v2x.CAM.", "from_users", label="mine", detail="why")
    ((confirm, targets),) = bench.confirms
    assert (confirm.outcome, confirm.reason, confirm.detail, targets) == (
        Outcome.REFUSED,
        Reason.BAD_ENVELOPE,
        "why",
        [],
    )
    assert confirm.request.label == "mine"
    assert (bench.router.requests, bench.refused) == (1, 1)


ASKED = st.sampled_from(
    [NOTHING_ASKED, NAMES_NOBODY, parse(b"{}"), parse(b'{"btp_port": 1}'), parse(b'{"interfaces": ["g5"]}')]
)
ACTIONS = st.one_of(
    st.tuples(st.just("request"), st.integers(0, 255), ASKED),
    st.tuples(st.just("link"), st.sampled_from(["g5", "mqtt"]), st.booleans()),
    st.tuples(st.just("refuse"), st.sampled_from(list(Reason)), st.none()),
    st.tuples(st.just("wait"), st.floats(0, 2), st.none()),
)


@given(st.lists(ACTIONS, max_size=30))
def test_every_request_is_accepted_or_refused_and_told_exactly_once(actions: list) -> None:
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop)
        bench.policy({"match": {"type": ["cam"]}, "rate_per_s": 1}, {"match": {"type": ["poi"]}, "interfaces": []})
        for what, first, second in actions:
            match what:
                case "request":
                    bench.request(first, pdu_of(first), second)
                case "link":
                    bench.link(first, second)
                case "refuse":
                    bench.router.refuse_message(first, b"", "from_users")
                case "wait":
                    loop.run_for(first)
        first_words = [
            confirm.request.number
            for confirm, _ in bench.confirms
            if confirm.outcome in (Outcome.ACCEPTED, Outcome.REFUSED)
        ]
        assert first_words == list(range(1, bench.router.requests + 1))
        assert bench.router.requests == bench.router.accepted + bench.refused


def indication_of(pdu: bytes = CAM_PDU) -> Indication:
    return Indication(Topics().by_number[2], pdu, "g5", 0, 0.0, NO_RX_INFO)


class Above(list[bytes]):
    """What the users were given; publish() as the router calls it."""

    def publish(self, indications: list[Indication]) -> None:
        self += [indication.pdu for indication in indications]

    observe = publish


def test_indications_pass_the_stages_in_their_order_and_are_published(bench: Bench) -> None:
    users = Above()
    bench.router.users = users
    bench.router.stages = (
        lambda indications: [one._replace(pdu=one.pdu + b"1") for one in indications],
        lambda indications: [one._replace(pdu=one.pdu + b"2") for one in indications],
    )
    bench.router.indicate(indication_of())
    bench.loop.run_for(0.0)
    assert users == [CAM_PDU + b"12"]


def test_what_a_stage_takes_out_meets_no_further_stage_and_no_user(bench: Bench) -> None:
    users = Above()
    bench.router.users = users
    bench.router.stages = (
        lambda indications: [one for one in indications if one.pdu != CAM_PDU],
        lambda indications: [one._replace(pdu=one.pdu + b"2") for one in indications],
    )
    bench.router.indicate(indication_of())
    bench.router.indicate(indication_of(b"other"))
    bench.router.flush()
    assert users == [b"other2"]


def test_who_observes_sees_what_came_before_any_stage_and_is_asked_no_more_when_gone(bench: Bench) -> None:
    seen = Above()
    bench.router.set_listeners([seen], [])
    bench.router.stages = (lambda indications: [],)
    bench.router.indicate(indication_of())
    bench.router.flush()
    assert seen == [CAM_PDU]
    bench.router.set_listeners([], [])
    bench.router.indicate(indication_of())
    bench.router.flush()
    assert seen == [CAM_PDU]


def test_what_one_turn_brings_goes_up_at_its_end_in_order(bench: Bench) -> None:
    users = Above()
    bench.router.users = users
    for number in range(3):
        bench.router.indicate(indication_of(pdu_of(2, number)))
    assert users == []
    bench.loop.run_for(0.0)
    assert users == [pdu_of(2, number) for number in range(3)]


def test_no_indication_waits_for_more_than_a_burst_of_others(bench: Bench) -> None:
    users = Above()
    bench.router.users = users
    for number in range(BURST + 1):
        bench.router.indicate(indication_of(pdu_of(2, number)))
    assert len(users) == BURST


def test_the_policy_may_ask_about_interfaces_that_do_not_exist(bench: Bench) -> None:
    assert not bench.router.is_up("nobody")
    assert bench.router.neighbours("nobody", 5.0, None, 1) == 0


def test_an_ability_is_there_while_an_interface_that_has_it_is_up(bench: Bench) -> None:
    assert not bench.router.has_up(Can.BEARER)
    bench.add("modem", Can.BEARER)
    assert bench.router.has_up(Can.BEARER)
    bench.link("modem", False)
    assert not bench.router.has_up(Can.BEARER)


def test_a_request_passes_the_stages_in_their_order(bench: Bench) -> None:
    bench.router.request_stages = (
        lambda request: request._replace(priority=1),
        lambda request: request._replace(label=f"was {request.priority}"),
    )
    bench.request()
    assert [(sent.priority, sent.label) for sent in bench.drivers["g5"].sent] == [(1, "was 1")]


def test_a_stage_may_refuse_a_request_with_its_reason(bench: Bench) -> None:
    bench.router.request_stages = (lambda request: Reason.POLICY,)
    bench.request()
    assert bench.refusals() == [Reason.POLICY]
    assert bench.sent_by("g5") == []
    assert (bench.router.requests, bench.router.accepted, bench.refused) == (1, 0, 1)
