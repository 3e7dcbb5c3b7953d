"""Requests of applications at brokers: interfaces that send them, and those that are left out."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from drivers.message import Outcome
from drivers.reason import Reason
from firmware.routing.interface import FROM_BROKERS
from tests.firmware.doubles import CAM_PDU, pdu_of
from tests.firmware.routing.router_bench import Bench
from tests.virtual import VirtualLoop

BROKER, OTHER_BROKER = "mqtt://localhost:1883", "mqtts://broker.example:8883"


@pytest.fixture
def bench() -> Iterator[Bench]:
    """Return a station with g5 and an interface `nap` at a broker."""
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop, "g5")
        bench.add("nap", broker=BROKER)
        yield bench


def ask(bench: Bench, pdu: bytes = CAM_PDU, btp_port: int | None = None) -> None:
    """Send a request of an application at the broker of `nap`."""
    bench.router.interfaces["nap"].request(pdu, btp_port)


def test_request_of_an_application_leaves_by_other_interfaces_and_is_confirmed(bench: Bench) -> None:
    ask(bench)
    assert (bench.sent_by("g5"), bench.sent_by("nap")) == ([1], [])
    assert (bench.router.requests, bench.router.accepted) == (1, 1)
    (accepted, targets), (sent, _) = bench.confirms
    assert (accepted.outcome, targets) == (Outcome.ACCEPTED, ["g5"])
    assert (sent.outcome, sent.interface) == (Outcome.SENT, "g5")


def test_request_of_a_user_still_leaves_by_the_interface_at_the_broker(bench: Bench) -> None:
    ask(bench)
    bench.request()
    assert (bench.sent_by("g5"), bench.sent_by("nap")) == ([1, 2], [2])


def test_request_with_several_interfaces_at_its_broker_leaves_by_those_at_others(bench: Bench) -> None:
    bench.add("same", broker=BROKER)
    bench.add("other", broker=OTHER_BROKER)
    ask(bench)
    assert [bench.sent_by(name) for name in ("g5", "nap", "same", "other")] == [[1], [], [], [1]]


def test_request_with_only_its_origin_in_the_row_leaves_by_the_fallback(bench: Bench) -> None:
    bench.policy({"interfaces": ["nap"], "fallback": ["nap", "g5"]})
    ask(bench)
    assert (bench.sent_by("g5"), bench.sent_by("nap")) == ([1], [])


def test_request_while_the_other_link_is_down_waits_in_its_queue(bench: Bench) -> None:
    bench.link("g5", False)
    ask(bench)
    assert (bench.sent_by("g5"), bench.sent_by("nap")) == ([], [])
    bench.link("g5", True)
    assert bench.sent_by("g5") == [1]


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ({"interfaces": ["nap"]}, Reason.NO_INTERFACE),
        ({"interfaces": []}, Reason.POLICY),
        ({"rate_per_s": 1}, Reason.RATE_LIMIT),
    ],
)
def test_refused_request_is_confirmed_and_counted_with_its_origin(
    bench: Bench, row: dict[str, object], reason: Reason
) -> None:
    bench.policy(row)
    ask(bench)
    ask(bench)
    assert set(bench.refusals()) == {reason}
    assert bench.confirms[-1][0].detail.endswith(" nap" if reason is Reason.NO_INTERFACE else "")
    assert bool(bench.confirms[-1][0].detail) is (reason is Reason.NO_INTERFACE)
    assert bench.drops.total(FROM_BROKERS, reason) == len(bench.refusals())


def test_request_with_an_unknown_type_is_sent_only_with_a_port(bench: Bench) -> None:
    ask(bench, pdu_of(200))
    assert bench.drops.total(FROM_BROKERS, Reason.UNKNOWN_TYPE) == 1
    ask(bench, pdu_of(200), btp_port=3000)
    assert [sent.btp_port for sent in bench.drivers["g5"].sent] == [3000]
