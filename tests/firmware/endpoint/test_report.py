"""Reports: status once a second, confirms and indications."""

import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import closing

import pytest

from board.time.scales import Lock, TimeQuality
from drivers.implausible import Implausible
from drivers.message import NO_RX_INFO, Confirm, Indication, Outcome, RxInfo
from drivers.reason import MEANING, Reason
from firmware.endpoint.report import (
    AT_ONCE_S,
    BUDGET,
    FLOOD,
    LATER_S,
    MOST,
    OF_FLOOD,
    OF_IMPLAUSIBLE,
    SOON_S,
    Report,
    memory_kb,
    process_status,
)
from firmware.topics import Topics
from tests.firmware.doubles import CAM_PDU, NotingStation, interface_of, request_of
from tests.virtual import VirtualLoop


class NotingPublisher:
    def __init__(self) -> None:
        self.said: list[tuple[bytes, dict[str, object]]] = []

    def publish(self, topic: bytes, body: bytes) -> None:
        self.said.append((topic, json.loads(body)))

    def publish_all(self, messages: list[tuple[bytes, bytes]]) -> None:
        for topic, body in messages:
            self.publish(topic, body)


class Bench:
    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.publisher = NotingPublisher()
        self.made = self.refreshed = 0
        self.report = Report(loop, self.publisher, self.status, self.refresh, lambda: {"state": "locked"})

    def status(self) -> dict[str, object]:
        self.made += 1
        return {"station": "captain"}

    def refresh(self) -> None:
        self.refreshed += 1

    def told(self) -> list[tuple[bytes, dict[str, object]]]:
        """After the turns in which all that waits is told."""
        self.loop.run_for(1.5 * LATER_S)
        return self.publisher.said


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


def test_the_counters_are_refreshed_once_a_second_and_no_status_is_made_for_nobody(bench: Bench) -> None:
    bench.report.start()
    bench.loop.run_for(5.5)
    assert (bench.refreshed, bench.made, bench.publisher.said) == (6, 0, [])


def test_the_status_comes_once_a_second_while_somebody_listens(bench: Bench) -> None:
    bench.loop.run_for(AT_ONCE_S)
    bench.report.start()
    bench.report.status_interest(True)
    bench.publisher.said.clear()
    bench.loop.run_for(3.5)
    assert bench.publisher.said == [(b"status.", {"station": "captain"})] * 3
    bench.report.status_interest(False)
    bench.loop.run_for(3.0)
    assert len(bench.publisher.said) == 3


def test_who_subscribes_has_a_status_at_once(bench: Bench) -> None:
    bench.report.start()
    bench.loop.run_for(0.5)
    bench.report.status_interest(True)
    assert len(bench.publisher.said) == 1


def test_a_thousand_subscriptions_at_once_make_few_statuses(bench: Bench) -> None:
    bench.report.start()
    bench.loop.run_for(0.5)
    for _ in range(1000):
        bench.report.status_interest(True)
    assert len(bench.publisher.said) == 1
    bench.loop.run_for(AT_ONCE_S)
    assert len(bench.publisher.said) == 2


def test_status_that_is_due_is_not_published_after_its_last_subscriber_has_left(bench: Bench) -> None:
    bench.loop.run_for(AT_ONCE_S)
    bench.report.status_interest(True)
    bench.report.status_interest(True)
    bench.report.status_interest(False)
    bench.loop.run_for(AT_ONCE_S)
    assert len(bench.publisher.said) == 1


def test_an_accepted_request_names_its_interfaces(bench: Bench) -> None:
    target = interface_of(bench.loop, NotingStation())
    bench.report.confirm(Confirm(request_of(7), Outcome.ACCEPTED), (target,))
    ((topic, said),) = bench.told()
    assert topic == b"confirm.cam."
    assert (said["request"], said["outcome"], said["interfaces"]) == (7, "accepted", ["g5"])
    assert (said["type"], said["station_id"], said["octets"]) == ("cam", 1337, 10)
    assert (said["reason"], said["meaning"]) == (None, None)


def test_a_dropped_request_names_interface_reason_and_times(bench: Bench) -> None:
    confirm = Confirm(request_of(7), Outcome.DROPPED, "g5", Reason.EXPIRED, 1.5, 0.000_25, "too late")
    bench.report.confirm(confirm, ())
    ((_, said),) = bench.told()
    assert (said["outcome"], said["interface"], said["interfaces"]) == ("dropped", "g5", [])
    assert (said["reason"], said["meaning"], said["detail"]) == ("expired", MEANING[Reason.EXPIRED], "too late")
    assert (said["queue_us"], said["send_us"]) == (1_500_000.0, 250.0)


def test_a_status_comes_after_all_that_it_counts(bench: Bench) -> None:
    """It takes in what interfaces have brought a moment ago: who compares numbers would miss that."""

    def status() -> dict[str, object]:
        bench.report.observe(indications_of(CAM_PDU, CAM_PDU))
        return {"indications": bench.report.indications}

    bench.report._status = status
    bench.report.start()
    bench.report.status_interest(True)
    bench.loop.run_for(1.5)
    told = [(topic, said.get("sequence", said.get("indications"))) for topic, said in bench.publisher.said]
    for at, (topic, number) in enumerate(told):
        if topic == b"status.":
            assert number == sum(topic == b"indication.cam." for topic, _ in told[:at]) > 0


def test_a_confirm_and_an_indication_of_a_pdu_have_the_same_digest(bench: Bench) -> None:
    bench.report.confirm(Confirm(request_of(pdu=CAM_PDU), Outcome.ACCEPTED), ())
    bench.report.observe(indications_of(CAM_PDU))
    (_, confirm), (_, indication) = bench.told()
    assert confirm["digest"] == indication["digest"] == hashlib.sha256(CAM_PDU).hexdigest()[:16]


def test_a_confirm_says_when_its_request_was_accepted_however_late_it_is(bench: Bench) -> None:
    request = request_of()._replace(accepted=bench.loop.clock())
    before_ns = time.time_ns()
    bench.loop.run_for(3.0)  # of virtual time: the system's clock stands nearly still
    bench.report.confirm(Confirm(request, Outcome.SENT, "g5", None, 2.0, 1.0), ())
    bench.report.finish()  # before the virtual clock goes on, and the system's does not
    accepted_ns = bench.publisher.said[0][1]["accepted_ns"]
    assert isinstance(accepted_ns, int)
    assert before_ns - 3_000_000_000 <= accepted_ns <= time.time_ns() - 3_000_000_000


def test_confirms_and_indications_are_numbered_each_for_itself(bench: Bench) -> None:
    for _ in range(2):
        bench.report.confirm(Confirm(request_of(), Outcome.ACCEPTED), ())
    bench.report.observe(indications_of(CAM_PDU, CAM_PDU, CAM_PDU))
    assert [said["sequence"] for _, said in bench.told()] == [1, 2, 1, 2, 3]


def test_what_is_told_waits_for_the_message_itself(bench: Bench) -> None:
    bench.report.observe(indications_of(CAM_PDU))
    bench.report.confirm(Confirm(request_of(), Outcome.ACCEPTED), ())
    assert bench.publisher.said == []
    assert [topic for topic, _ in bench.told()] == [b"indication.cam.", b"confirm.cam."]


def test_who_gave_a_label_hears_of_it_soon_and_of_all_before_it(bench: Bench) -> None:
    bench.report.observe(indications_of(CAM_PDU))
    bench.loop.run_for(1.5 * SOON_S)
    assert bench.publisher.said == []
    bench.report.confirm(Confirm(request_of()._replace(label="mine"), Outcome.SENT, "g5"), ())
    bench.report.observe(indications_of(CAM_PDU))
    bench.loop.run_for(1.5 * SOON_S)
    assert [said["sequence"] for _, said in bench.publisher.said] == [1, 1, 2]
    assert len(bench.told()) == 3


def test_labels_among_the_rest_have_all_of_it_told_no_more_often(bench: Bench) -> None:
    times = 0
    for _ in range(1000):
        before = len(bench.publisher.said)
        bench.report.observe(indications_of(CAM_PDU))
        bench.report.confirm(Confirm(request_of()._replace(label="mine"), Outcome.SENT, "g5"), ())
        bench.loop.run_for(0.001)
        times += len(bench.publisher.said) > before
    assert times <= 1.0 / SOON_S


def test_who_is_in_a_hurry_hears_of_it_in_the_next_turn(bench: Bench) -> None:
    bench.report.is_hurried = True
    bench.report.observe(indications_of(CAM_PDU))
    assert bench.publisher.said == []
    bench.loop.run_for(0.0)
    assert len(bench.publisher.said) == 1


def test_what_waits_is_told_before_the_station_ends(bench: Bench) -> None:
    bench.report.observe(indications_of(CAM_PDU))
    bench.report.finish()
    assert len(bench.publisher.said) == 1


def test_in_a_flood_what_has_a_label_or_a_reason_is_told_and_the_rest_numbered(bench: Bench) -> None:
    for _ in range(BUDGET + 1):
        bench.report.confirm(Confirm(request_of(), Outcome.SENT, "g5"), ())
    bench.report.confirm(Confirm(request_of()._replace(label="mine"), Outcome.SENT, "g5"), ())
    bench.report.confirm(Confirm(request_of(), Outcome.DROPPED, "g5", Reason.QUEUE_FULL), ())
    assert [said["sequence"] for _, said in bench.told()] == [*range(1, BUDGET + 1), BUDGET + 2, BUDGET + 3]


def test_however_much_is_to_be_told_in_any_case_what_waits_is_bounded(bench: Bench) -> None:
    count = MOST + 100
    for _ in range(count):
        bench.report.confirm(Confirm(request_of(), Outcome.REFUSED, "", Reason.NO_PORT), ())
    assert len(bench.publisher.said) >= 100
    assert len(bench.told()) == count


def test_in_a_flood_indications_are_numbered_and_not_all_told(bench: Bench) -> None:
    bench.report.start()
    bench.report.observe(indications_of(*[CAM_PDU] * BUDGET))
    bench.report.observe(indications_of(CAM_PDU, CAM_PDU))
    bench.loop.run_for(1.5)
    bench.report.observe(indications_of(CAM_PDU))
    assert len(bench.told()) == BUDGET + 1
    assert bench.told()[-1][1]["sequence"] == BUDGET + 3


def test_after_a_second_of_ten_times_as_many_fewer_are_told(bench: Bench) -> None:
    bench.report.start()
    told = []
    for count in (FLOOD, FLOOD + 1, FLOOD, BUDGET):
        bench.publisher.said.clear()
        bench.report.observe(indications_of(*[CAM_PDU] * (count - 1)))
        bench.report.confirm(Confirm(request_of(), Outcome.SENT, "g5"), ())
        bench.loop.run_for(1.0)
        told.append(len(bench.told()))
    assert told == [BUDGET, BUDGET, OF_FLOOD, BUDGET]


@pytest.mark.parametrize("size", range(6))
def test_a_pdu_that_holds_no_station_has_none(bench: Bench, size: int) -> None:
    bench.report.confirm(Confirm(request_of(pdu=bytes(size)), Outcome.REFUSED, reason=Reason.SHORT_PDU), ())
    assert bench.told()[0][1]["station_id"] is None


def test_a_confirm_of_an_unknown_type_has_two_dots(bench: Bench) -> None:
    bench.report.confirm(Confirm(request_of(kind=Topics().unknown), Outcome.REFUSED, reason=Reason.UNKNOWN_TYPE), ())
    assert bench.told()[0][0] == b"confirm.."


def test_a_label_of_any_text_comes_back_as_it_was(bench: Bench) -> None:
    label = 'ü☃"\\\n\x00\ud800'
    bench.report.confirm(Confirm(request_of()._replace(label=label), Outcome.ACCEPTED), ())
    assert bench.told()[0][1]["label"] == label


def test_the_process_says_what_it_takes() -> None:
    status = process_status(started=10.0, now=12.5)
    assert status["uptime_s"] == 2.5
    assert memory_kb() > 1000


def test_in_a_flood_of_implausible_messages_some_are_told_all_are_numbered_and_the_rest_is_as_usual(
    bench: Bench,
) -> None:
    bench.report.start()
    marked = indications_of(*[CAM_PDU] * (BUDGET + 1), rx=RxInfo(implausible=(Implausible.TIME,)))
    bench.report.implausible.observe(marked)
    bench.report.observe(indications_of(CAM_PDU))
    told = bench.told()
    assert [topic for topic, _ in told] == [b"implausible.cam."] * OF_IMPLAUSIBLE + [b"indication.cam."]
    bench.loop.run_for(1.0)
    bench.report.implausible.observe(marked[:1])
    assert told[-1][1]["sequence"] == BUDGET + 2


def indications_of(*pdus: bytes, rx: RxInfo = NO_RX_INFO) -> list[Indication]:
    kind = Topics().by_number[2]
    quality = TimeQuality(Lock.LOCKED, offset_ns=-100, uncertainty_ns=5_000)
    return [Indication(kind, pdu, "g5", 1_795_182_426_461_613_001, 12.5, rx, quality) for pdu in pdus]


def test_an_indication_says_how_well_the_time_of_its_reception_is_known(bench: Bench) -> None:
    rx = RxInfo(btp_port=2001, rssi_dbm=-71, source_mac=bytes.fromhex("02000000beef"))
    bench.report.observe(indications_of(CAM_PDU, rx=rx))
    assert bench.told() == [
        (
            b"indication.cam.",
            {
                "sequence": 1,
                "type": "cam",
                "station_id": 1337,
                "octets": len(CAM_PDU),
                "digest": hashlib.sha256(CAM_PDU).hexdigest()[:16],
                "interface": "g5",
                "received_ns": 1_795_182_426_461_613_001,
                "monotonic": 12.5,
                "btp_port": 2001,
                "rssi_dbm": -71,
                "source": "02:00:00:00:be:ef",
                "quality": {"state": "locked", "error_ns": 5_100, "offset_ns": -100, "uncertainty_ns": 5_000},
            },
        )
    ]


def test_what_is_not_known_of_an_indication_is_null_or_empty(bench: Bench) -> None:
    bench.report.observe([one._replace(quality=TimeQuality()) for one in indications_of(CAM_PDU)])
    ((_, told),) = bench.told()
    assert (told["btp_port"], told["rssi_dbm"], told["source"]) == (None, None, "")
    assert told["quality"] == {"state": "unknown", "error_ns": None, "offset_ns": None, "uncertainty_ns": None}


def test_a_client_of_a_broker_is_the_source_of_what_it_has_sent(bench: Bench) -> None:
    bench.report.observe(indications_of(CAM_PDU, rx=RxInfo(source="vehicle-7")))
    assert bench.told()[0][1]["source"] == "vehicle-7"


def test_the_time_comes_once_a_second_while_somebody_listens(bench: Bench) -> None:
    bench.report.start()
    bench.report.time_interest(True)
    bench.loop.run_for(3.5)
    assert bench.told() == [(b"time.", {"state": "locked"})] * 3
    bench.report.time_interest(False)
    bench.loop.run_for(3.0)
    assert len(bench.told()) == 3
