"""One interface: what it lets up, what it counts, and what its driver may tell it."""

import logging
from collections.abc import Iterator
from contextlib import closing
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import InterfaceError, RequestError
from board.runtime.journal import DECISIONS
from board.time.scales import Lock, TimeQuality
from drivers.contract import Can, Sent
from drivers.message import Area, Outcome, Position, RxInfo, Shape
from drivers.reason import Reason
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface
from firmware.topics import Topics
from tests.firmware.doubles import CAM_PDU, NotingStation, ScriptedDriver, interface_of, pdu_of, request_of
from tests.said import tells
from tests.virtual import VirtualLoop

MAC = bytes.fromhex("02000000000b")


class Bench:
    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.above = NotingStation()
        self.driver = ScriptedDriver()
        self.drops = Drops()
        self.interface: Interface = interface_of(loop, self.above, self.driver, drops=self.drops)

    @property
    def indicated(self) -> list[bytes]:
        return [indication.pdu for indication in self.above.indications]


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


@pytest.mark.parametrize(
    ("size", "reason"),
    [
        (0, Reason.EMPTY_PDU),
        (1, Reason.SHORT_PDU),
        (5, Reason.SHORT_PDU),
        (1501, Reason.LONG_PDU),
        (65536, Reason.LONG_PDU),
    ],
)
def test_a_pdu_of_this_size_goes_no_further(bench: Bench, size: int, reason: Reason) -> None:
    bench.interface.indicate(b"\x02" * size, 0)
    assert bench.indicated == []
    assert bench.drops.total("g5", reason) == 1
    bench.interface.indicate(CAM_PDU, 0)
    assert bench.indicated == [CAM_PDU]


@pytest.mark.parametrize("btp_port", [None, 3000])
def test_request_of_an_application_is_passed_on_with_its_type_and_interface(bench: Bench, btp_port: int | None) -> None:
    bench.interface.request(CAM_PDU, btp_port)
    assert bench.above.requests == [("cam", CAM_PDU, "from_brokers", btp_port, bench.interface)]
    assert (bench.indicated, sum(bench.interface.received)) == ([], 0)


def test_an_indication_has_the_quality_of_the_time_when_it_came(bench: Bench) -> None:
    for quality in (TimeQuality(), TimeQuality(Lock.LOCKED, 100, 5000)):
        bench.above.quality = quality
        bench.interface.indicate(CAM_PDU, 0)
        assert bench.above.indications[-1].quality is quality


def test_a_quality_from_before_the_loop_stood_still_is_renewed(bench: Bench) -> None:
    bench.above.quality = TimeQuality(Lock.LOCKED, 100, 5000)
    bench.above.quality_until = -1.0
    bench.above.renewed = TimeQuality(Lock.HOLDOVER, 100, 9000)
    bench.interface.indicate(CAM_PDU, 1)
    assert bench.above.indications[-1].quality is bench.above.renewed


@pytest.mark.parametrize("size", [6, 7, 1499, 1500])
def test_a_pdu_of_this_size_is_passed_on_unchanged(bench: Bench, size: int) -> None:
    pdu = b"\x02" * size
    bench.interface.indicate(pdu, 17)
    (indication,) = bench.above.indications
    assert (indication.pdu, indication.received_ns, indication.interface) == (pdu, 17, "g5")
    assert indication.kind.name == "cam"


@given(st.binary(max_size=1600))
def test_any_octets_are_passed_on_or_explained(octets: bytes) -> None:
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop)
        bench.interface.indicate(octets, 0)
        assert len(bench.indicated) + len(list(bench.drops.status())) == 1


def test_an_unknown_id_is_passed_on_without_a_name(bench: Bench) -> None:
    bench.interface.indicate(pdu_of(222), 0)
    assert bench.above.indications[0].kind.name == ""


@pytest.mark.parametrize("port", [2001, 2018, 2019])
def test_a_port_of_either_profile_is_accepted(bench: Bench, port: int) -> None:
    bench.interface.indicate(CAM_PDU, 0, RxInfo(btp_port=port))
    assert len(bench.indicated) == 1


@pytest.mark.parametrize("port", [0, 1, 2000, 65535])
def test_a_port_that_no_table_has_is_dropped(bench: Bench, port: int) -> None:
    bench.interface.indicate(CAM_PDU, 0, RxInfo(btp_port=port))
    assert bench.indicated == []
    assert bench.drops.total("g5", Reason.BTP_PORT) == 1


@pytest.mark.parametrize("size", [0, 1, 5, 1501])
def test_of_a_port_that_no_table_has_any_size_is_dropped_for_its_port(bench: Bench, size: int) -> None:
    bench.interface.indicate(bytes(size), 0, RxInfo(btp_port=42))
    assert bench.drops.total("g5", Reason.BTP_PORT) == bench.drops.sum("g5", frozenset({Reason.DUPLICATE})) == 1


@pytest.mark.parametrize(("size", "reason"), [(0, Reason.EMPTY_PDU), (1501, Reason.LONG_PDU)])
def test_of_a_wanted_port_that_no_table_has_an_impossible_size_is_dropped(
    bench: Bench, size: int, reason: Reason
) -> None:
    bench.interface.accept_any_port()
    bench.interface.indicate(bytes(size), 0, RxInfo(btp_port=42))
    assert bench.drops.total("g5", reason) == bench.drops.sum("g5", frozenset({Reason.DUPLICATE})) == 1


def test_a_port_that_no_table_has_is_accepted_where_that_is_wanted(bench: Bench) -> None:
    bench.interface.accept_any_port()
    bench.interface.indicate(CAM_PDU, 0, RxInfo(btp_port=1))
    assert len(bench.indicated) == 1


def test_what_is_dropped_makes_no_neighbour(bench: Bench) -> None:
    bench.interface.indicate(b"abc", 0, RxInfo(source_mac=MAC))
    bench.interface.indicate(CAM_PDU, 0, RxInfo(btp_port=1, source_mac=MAC))
    assert bench.interface.neighbours.count(bench.loop.now) == 0


def test_neighbours_are_told_apart_by_mac_or_else_by_station(bench: Bench) -> None:
    bench.interface.indicate(pdu_of(2, 1), 0, RxInfo(source_mac=MAC))
    bench.interface.indicate(pdu_of(2, 2), 0, RxInfo(source_mac=MAC))
    bench.interface.indicate(pdu_of(2, 3), 0)
    bench.interface.indicate(pdu_of(2, 4), 0)
    assert bench.interface.neighbours.count(bench.loop.now) == 3


def test_a_beacon_makes_a_neighbour_and_no_message(bench: Bench) -> None:
    bench.interface.heard(MAC, -70)
    assert bench.interface.neighbours.count(bench.loop.now, 5.0, -70) == 1
    assert bench.indicated == []


def test_what_the_driver_discards_is_counted_here(bench: Bench) -> None:
    bench.interface.drop(Reason.KERNEL_QUEUE, count=12)
    assert bench.drops.total("g5", Reason.KERNEL_QUEUE) == 12


def test_a_sent_request_is_counted_by_type_and_confirmed_with_its_times(bench: Bench) -> None:
    bench.driver.answer = Sent.LATER
    bench.loop.now += 3
    bench.interface.outlet.submit(request_of(7, accepted=1001.0))
    bench.loop.now += 2
    bench.interface.confirm(bench.driver.sent[0])
    (confirm,) = bench.above.confirms
    assert (confirm.outcome, confirm.interface, confirm.queue_s, confirm.send_s) == (Outcome.SENT, "g5", 2.0, 2.0)
    assert bench.interface.status()["sent"] == {"cam": 1}
    assert bench.interface.status()["sent_octets"] == len(CAM_PDU)


def test_a_dropped_request_is_counted_and_confirmed_with_its_reason(bench: Bench) -> None:
    bench.driver.answer = Sent.LATER
    bench.interface.outlet.submit(request_of(7))
    bench.interface.confirm(bench.driver.sent[0], Reason.SEND_FAILED)
    assert bench.above.outcomes() == [(7, Outcome.DROPPED, Reason.SEND_FAILED)]
    assert bench.drops.total("g5", Reason.SEND_FAILED) == 1
    assert bench.interface.status()["sent"] == {}


def test_request_that_a_driver_can_never_send_is_dropped_with_the_reason(bench: Bench) -> None:
    why = "1400 octets do not fit"
    bench.driver.answer = RequestError(why, "send less")
    bench.interface.outlet.submit(request_of(7))
    (confirm,) = bench.above.confirms
    assert confirm.reason is Reason.SEND_FAILED
    assert why in confirm.detail
    assert bench.drops.total("g5", Reason.SEND_FAILED) == 1


def test_no_confirm_is_made_that_nobody_wants_but_all_is_counted(bench: Bench) -> None:
    bench.above.is_confirm_wanted = False
    bench.interface.outlet.submit(request_of(1))
    bench.driver.answer = RequestError("no")
    bench.interface.outlet.submit(request_of(2))
    assert bench.above.confirms == []
    assert bench.interface.status()["sent"] == {"cam": 1}
    assert bench.drops.total("g5", Reason.SEND_FAILED) == 1


def test_a_link_that_goes_down_and_up_is_told_once_each(bench: Bench) -> None:
    before = bench.above.link_changes
    for _ in range(3):
        bench.interface.link(False, "unplugged")
    assert bench.above.link_changes == before + 1
    for _ in range(3):
        bench.interface.link(True, "plugged in")
    assert bench.above.link_changes == before + 2


def test_another_reason_for_the_same_state_is_shown_and_the_state_is_as_old_as_before(bench: Bench) -> None:
    bench.interface.link(False, "unplugged")
    bench.loop.now += 5
    bench.interface.link(False, "still unplugged")
    status = bench.interface.status()
    assert (status["why"], status["since_s"]) == ("still unplugged", 5.0)


def test_link_that_flaps_floods_no_journal_and_is_counted(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "captain.interface")
    for turn in range(1800):
        bench.interface.link(turn % 2 == 1, f"try {turn}")
        bench.loop.run_for(2.0)
    assert len(caplog.records) <= DECISIONS.burst + 3600 / DECISIONS.every_s
    assert tells(caplog.records[-1].getMessage(), "(4 lines omitted")
    assert bench.above.link_changes == 1 + 1800


def test_a_link_that_comes_up_sends_what_has_waited(bench: Bench) -> None:
    bench.interface.link(False, "unplugged")
    bench.interface.outlet.submit(request_of(1))
    assert bench.driver.sent == []
    bench.interface.link(True, "plugged in")
    assert [request.number for request in bench.driver.sent] == [1]


def test_a_link_that_comes_up_asks_a_driver_that_was_busy_again(bench: Bench) -> None:
    bench.driver.answer = Sent.BUSY
    bench.interface.outlet.submit(request_of(1))
    bench.interface.link(False, "unplugged")
    bench.driver.answer = Sent.NOW
    bench.interface.link(True, "plugged in")
    assert [request.number for request in bench.driver.sent] == [1]


def test_a_failure_takes_the_link_down_and_is_passed_to_the_supervisor(bench: Bench) -> None:
    failures = []
    bench.interface.supervisor = SimpleNamespace(driver_failed=failures.append)
    bench.interface.fail(InterfaceError("gone", "plug it in"))
    assert not bench.interface.is_up
    assert [error.message for error in failures] == ["gone"]
    assert bench.interface.why == "gone"


def test_a_driver_that_fails_inside_send_loses_nothing(bench: Bench) -> None:
    class Failing(ScriptedDriver):
        def send(self, request: object) -> Sent:
            bench.interface.fail(InterfaceError("gone"))
            return Sent.BUSY

    bench.interface.driver = Failing()
    bench.interface.outlet.submit(request_of(1))
    assert bench.interface.outlet.length == 1
    bench.interface.driver = bench.driver
    bench.interface.link(True, "back")
    assert [request.number for request in bench.driver.sent] == [1]


@pytest.mark.parametrize(("can", "is_able"), [(Can.RECEIVE, False), (Can.TRANSMIT, True), (~Can.TRANSMIT, False)])
def test_only_a_driver_that_can_transmit_does(can: Can, is_able: bool) -> None:
    with closing(VirtualLoop()) as loop:
        assert interface_of(loop, NotingStation(), ScriptedDriver(can)).can_transmit is is_able


def test_types_of_one_name_are_counted_together() -> None:
    with closing(VirtualLoop()) as loop:
        interface = interface_of(loop, NotingStation())
        for number in (16, 102, 102, 99, 100):
            interface.indicate(pdu_of(number), 0)
        assert interface.status()["received"] == {"vam": 3, "unknown": 2}


def test_nameless_types_of_the_legacy_profile_are_counted_with_the_unknown() -> None:
    with closing(VirtualLoop()) as loop:
        interface = interface_of(loop, NotingStation(), topics=Topics("legacy"))
        for number in (15, 20, 99):
            interface.indicate(pdu_of(number), 0)
        assert interface.status()["received"] == {"unknown": 3}


@pytest.mark.parametrize(
    ("can", "is_sent"),
    [(Can.TRANSMIT, False), (Can.TRANSMIT | Can.GEOBROADCAST, True), (Can.TRANSMIT | Can.ANYWHERE, True)],
)
def test_an_area_leaves_only_by_an_interface_that_carries_it_or_needs_not_to(can: Can, is_sent: bool) -> None:
    with closing(VirtualLoop()) as loop:
        drops, driver = Drops(), ScriptedDriver(can)
        interface = interface_of(loop, NotingStation(), driver, drops=drops)
        request = request_of()._replace(area=Area(Shape.CIRCLE, Position(), 100))
        interface.outlet.submit(request)
        assert driver.sent == ([request] if is_sent else [])
        assert drops.total("g5", Reason.NO_AREA) == (0 if is_sent else 1)


def test_octets_are_counted_both_ways(bench: Bench) -> None:
    bench.interface.indicate(CAM_PDU, 0)
    bench.interface.indicate(CAM_PDU + b"more", 0)
    status = bench.interface.status()
    assert (status["received_octets"], status["sent_octets"]) == (2 * len(CAM_PDU) + 4, 0)


def test_a_neighbour_behind_a_broker_is_known_by_its_client_where_it_says_so(bench: Bench) -> None:
    for station, rx in ((1, RxInfo(source="car-7")), (2, RxInfo(source="car-7")), (3, RxInfo())):
        bench.interface.indicate(pdu_of(2, station), 0, rx)
    assert bench.interface.neighbours.count(bench.loop.now) == 2
    bench.interface.indicate(pdu_of(2, 4), 0, RxInfo(source="car-8", source_mac=MAC))
    bench.interface.indicate(pdu_of(2, 5), 0, RxInfo(source_mac=MAC))
    assert bench.interface.neighbours.count(bench.loop.now) == 3


def test_what_the_driver_says_of_a_failure_reaches_the_confirm(bench: Bench) -> None:
    bench.driver.answer = Sent.LATER
    first, second = request_of(1), request_of(2)
    bench.interface.outlet.submit(first)
    bench.interface.outlet.submit(second)
    bench.interface.confirm(first, Reason.SEND_FAILED, "mqtts://broker.example:8883: Not authorized")
    bench.interface.confirm(second)
    assert [(confirm.outcome, confirm.detail) for confirm in bench.above.confirms] == [
        (Outcome.DROPPED, "mqtts://broker.example:8883: Not authorized"),
        (Outcome.SENT, ""),
    ]


def test_detail_of_a_driver_for_a_request_is_kept_with_the_last_sample(bench: Bench) -> None:
    bench.driver.answer = Sent.LATER
    bench.interface.outlet.submit(request_of(7))
    detail = "the broker has no room"
    bench.interface.confirm(bench.driver.sent[0], Reason.SEND_FAILED, detail)
    (said,) = bench.drops.status()
    assert said["detail"] == detail
