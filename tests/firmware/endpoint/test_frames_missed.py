"""Frames for a recorder: missed ones are counted in a flood and after drops."""

import math
from contextlib import closing

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.message import (
    Confirm,
    Outcome,
)
from drivers.reason import Reason
from firmware.endpoint.frames import FLOOD, LATER_S, MOST, OF_FLOOD
from tests.firmware.doubles import CAM_PDU, pdu_of, request_of
from tests.firmware.endpoint.frames_bench import NOW_NS, Bench, bench, gn_frame, linked, unix_time
from tests.virtual import VirtualLoop

__all__ = ["bench", "unix_time"]  # fixtures


def test_drops_of_other_places_are_not_frames(bench: Bench) -> None:
    bench.drops.count("report", Reason.SUBSCRIBER_SLOW, b"{}")
    bench.drops.count("pull", Reason.BAD_ENVELOPE, b"x")
    assert bench.later() == []


def test_what_the_kernel_dropped_is_missed(bench: Bench) -> None:
    bench.drops.count("air", Reason.KERNEL_QUEUE, count=40)
    bench.indicate(CAM_PDU)
    assert [said["missed"] for said in bench.later()] == [40]
    bench.indicate(CAM_PDU)
    assert [said["missed"] for said in bench.later()] == [0]


def test_of_a_flood_the_rest_is_counted(bench: Bench) -> None:
    link, _ = linked(bench)
    for number in range(MOST + 30):
        link.receive(gn_frame(pdu_of(2, number)), NOW_NS)
    assert len(bench.later()) == MOST
    bench.indicate(pdu_of(2), "wire")
    link.receive(gn_frame(pdu_of(2, 7000)), NOW_NS)
    assert [(said["interface"], said["missed"], said["sequence"]) for said in bench.later()] == [
        ("wire", 0, 1),
        ("air", 30, MOST + 1),
    ]


def test_of_a_flood_of_refusals_each_is_counted_once(bench: Bench) -> None:
    for number in range(MOST + 30):
        request = request_of(number, pdu=pdu_of(2, number))
        bench.drops.count("wire", Reason.QUEUE_FULL, request.pdu)
        bench.confirm(Confirm(request, Outcome.DROPPED, "wire", Reason.QUEUE_FULL))
    assert len(bench.later()) == MOST
    bench.indicate(pdu_of(2), "wire")
    assert [said["missed"] for said in bench.later()] == [30]


EVENTS = ("in", "out", "dropped", "refused", "duplicate", "kernel", "wait")


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.sampled_from(EVENTS), st.integers(1, 2 * MOST)), max_size=12))
def test_what_is_told_and_what_is_missed_come_to_all_that_was(events: list[tuple[str, int]]) -> None:
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop)
        happened = 0
        numbers = iter(range(10**6))
        for what, count in events:
            for _ in range(count if what != "wait" else 0):
                pdu = pdu_of(2, next(numbers))
                request = request_of(next(numbers), pdu=pdu)
                match what:
                    case "in":
                        bench.indicate(pdu, "wire")
                    case "duplicate":
                        bench.indicate(pdu, "wire")
                        bench.drops.count("wire", Reason.DUPLICATE, pdu)
                    case "kernel":
                        bench.drops.count("wire", Reason.KERNEL_QUEUE)
                    case "out":
                        bench.confirm(Confirm(request, Outcome.SENT, "wire"))
                    case "dropped":
                        bench.drops.count("wire", Reason.QUEUE_FULL, pdu)
                        bench.confirm(Confirm(request, Outcome.DROPPED, "wire", Reason.QUEUE_FULL))
                    case "refused":
                        bench.confirm(Confirm(request, Outcome.REFUSED, "", Reason.POLICY))
                happened += 1
            if what == "wait":
                loop.run_for(LATER_S * count / MOST)
        loop.run_for(1.0)
        bench.indicate(pdu_of(2), "wire")
        bench.confirm(Confirm(request_of(), Outcome.REFUSED, "", Reason.POLICY))
        loop.run_for(1.0)
        assert len(bench.told) + sum(said["missed"] for _, said, _ in bench.told) == happened + 2
        assert all(said["missed"] >= 0 for _, said, _ in bench.told)


def test_what_fills_the_room_is_told_as_dropped_if_it_was(bench: Bench) -> None:
    pdus = [pdu_of(2, number) for number in range(MOST)]
    for pdu in pdus:
        bench.indicate(pdu, "wire")
    for pdu in pdus:
        bench.drops.count("wire", Reason.DUPLICATE, pdu)
    assert not bench.is_shown
    assert {said.get("reason") for said in bench.later()} == {"duplicate"}


def test_in_a_flood_it_looks_away_and_looks_again(bench: Bench) -> None:
    for _ in range(10):
        for number in range(10 * MOST):
            bench.indicate(pdu_of(2, number), "wire")
        assert not bench.is_shown
        bench.loop.run_for(LATER_S * 1.5)
        assert bench.is_shown
    assert len(bench.told) == 10 * MOST


def test_the_more_comes_the_less_of_it_is_told(bench: Bench) -> None:
    counts = (FLOOD + MOST, FLOOD + MOST + 1, FLOOD + OF_FLOOD + 1, FLOOD, MOST, 1)
    told = []
    for count in counts:
        for number in range(count):
            bench.indicate(pdu_of(2, number), "wire")
        told.append(bench.later())
    assert [len(some) for some in told] == [MOST, MOST, OF_FLOOD, OF_FLOOD, MOST, 1]
    assert sum(1 + one["missed"] for some in told for one in some) == sum(counts)


def test_drops_that_no_confirm_follows_are_missed_for_good(bench: Bench) -> None:
    for number in range(MOST + 1):
        bench.indicate(pdu_of(2, number), "wire")
    lost = pdu_of(2, 7000)
    bench.drops.count("wire", Reason.BTP_PORT, lost)
    bench.drops.count("wire", Reason.KERNEL_QUEUE, count=5)
    bench.later()
    empty = request_of(pdu=b"")
    bench.confirm(Confirm(empty, Outcome.DROPPED, "wire", Reason.EXPIRED))
    bench.confirm(Confirm(request_of(pdu=lost), Outcome.SENT, "wire"))
    assert [said["missed"] for said in bench.later()] == [7, 0]


def test_what_waits_is_told_before_the_station_ends(bench: Bench) -> None:
    for number in range(MOST - 1):
        bench.indicate(pdu_of(2, number), "wire")
    bench.drops.count("air", Reason.BTP_PORT, pdu_of(2, 7000))
    bench.frames.finish()
    assert [said.get("reason") for _, said, _ in bench.told] == [None] * (MOST - 1) + ["btp-port"]
    assert len(bench.later()) == MOST


def test_a_listener_who_left_leaves_nothing_behind(bench: Bench) -> None:
    bench.indicate(CAM_PDU)
    bench.frames.forget()
    assert bench.later() == []
    bench.indicate(CAM_PDU)
    assert len(bench.later()) == 1


def test_frames_of_requests_that_nobody_confirms_are_bounded(bench: Bench) -> None:
    link, _ = linked(bench)
    for number in range(5000):
        link.encode(request_of(number, deadline=math.inf))
    assert len(bench.frames._made) < 5000
