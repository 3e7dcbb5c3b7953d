import json

import pytest
import zmq

from drivers.message import RxInfo
from drivers.wire import raw
from firmware.client import client
from firmware.client.marks import LATE_MS, Marks
from firmware.client.received import Message
from firmware.endpoint.report import digest_of

CAM = bytes.fromhex("02020000053900010203")
RECEIVED_NS = 1795182426_461613000
MESSAGE = Message("cam", CAM, raw.parse(raw.build(CAM, RECEIVED_NS, RxInfo())))


class Reports:
    """A subscriber whose reports are there already; waits holds how long each poll() may wait, in ms."""

    def __init__(self) -> None:
        self.reports: list[list[bytes]] = []
        self.waits: list[int] = []

    def poll(self, wait_ms: int) -> bool:
        self.waits.append(wait_ms)
        return bool(self.reports)

    def recv_multipart(self, flags: int) -> list[bytes]:
        if not self.reports:
            raise zmq.Again
        return self.reports.pop(0)


@pytest.fixture
def reports(monkeypatch: pytest.MonkeyPatch) -> Reports:
    made = Reports()
    monkeypatch.setattr(client, "subscribe", lambda *_, url: made)
    return made


@pytest.fixture
def marks(reports: Reports) -> Marks:
    with client.session() as context:
        return Marks(context, client.Address())


def mark(*reasons: str, received_ns: int = RECEIVED_NS) -> list[bytes]:
    said = {"digest": digest_of(CAM), "received_ns": received_ns, "implausible": reasons}
    return [b"implausible.cam.", json.dumps(said).encode()]


def test_marks_of_a_station_that_sends_none_are_not_waited_for(marks: Marks, reports: Reports) -> None:
    marks.look()
    marks.look()
    assert reports.waits == [0, 0]
    assert marks.marked(MESSAGE) is MESSAGE


def test_marks_are_waited_for_after_the_first(marks: Marks, reports: Reports) -> None:
    reports.reports = [mark("time", "source")]
    marks.look()
    marks.look()
    assert reports.waits == [0, LATE_MS]
    assert marks.marked(MESSAGE).implausible == ("time", "source")


def test_a_mark_of_the_same_pdu_at_another_time_is_not_its_own(marks: Marks, reports: Reports) -> None:
    reports.reports = [mark("time", received_ns=RECEIVED_NS + 1000)]
    marks.look()
    assert marks.marked(MESSAGE).implausible == ()


@pytest.mark.parametrize("body", [b"{", b"[]", b"{}", b'{"digest": 1, "received_ns": "x", "implausible": 3}'])
def test_rubbish_among_marks_is_left_out(marks: Marks, reports: Reports, body: bytes) -> None:
    reports.reports = [[b"implausible.cam.", body], [b"implausible.cam."], mark("position")]
    marks.look()
    assert marks.marked(MESSAGE).implausible == ("position",)


def test_marks_without_a_report_port_are_none_and_cost_no_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "reach", lambda *_: pytest.fail("it was waited for"))
    with client.session() as context:
        marks = Marks(context, client.Address(report=1))
        marks.look()
        assert marks.marked(MESSAGE) is MESSAGE
