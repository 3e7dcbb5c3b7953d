"""Loss and unseen messages, for silent, slow and restarted stations."""

import json
import os
import signal
from collections import deque
from collections.abc import Iterator
from typing import Any

import pytest
import zmq

from board.runtime.errors import StationError
from drivers.message import NO_RX_INFO
from drivers.wire import raw
from firmware.client import client
from firmware.commands import meter as command
from firmware.meter.fate import Fate, Settled, Way
from firmware.meter.meter import Meter
from firmware.meter.report.spots import Spots
from firmware.meter.session import Session, TimeLine
from firmware.meter.watch.station import LABEL, SILENT_S, Watch
from firmware.meter.watch.tap import GLANCE, Tap
from tests.firmware.meter.watch.test_status_fields import CONFIRM, INDICATION

STATUS: dict[str, Any] = {
    "station": "captain", "version": "9.9", "pid": 7, "boot": "boot", "configuration": "cafe",
    "interfaces": {"g5": {"technology": "its-g5"}}, "report": {"confirms": 0, "indications": 0},
    "clock": {"state": "locked", "offset_ns": 0, "uncertainty_ns": 1000},
    "position": {"latitude": 48.0, "longitude": 11.0, "source": "configured"},
}  # fmt: skip
WAY = Way("A", "g5", "B", "g5")


class FakeSocket:
    """A SUB socket with what has come."""

    def __init__(self) -> None:
        self.waiting: deque[list[bytes]] = deque()
        self.asked: list[tuple[int, bytes]] = []

    def say(self, topic: str, said: dict[str, Any]) -> None:
        self.waiting.append([topic.encode(), json.dumps(said).encode()])

    def recv_multipart(self, flags: int = 0) -> list[bytes]:
        if not self.waiting:
            raise zmq.Again
        return self.waiting.popleft()

    def poll(self, timeout: float) -> int:
        return len(self.waiting)

    def setsockopt(self, option: int, topic: bytes) -> None:
        self.asked.append((option, topic))


class Bench:
    """Stations A and B, a meter, and a time line that is moved by hand."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.meter = Meter(grace_s=1.0)
        self.delivered: list[tuple[str, str]] = []
        self.watches: dict[str, Watch] = {}
        self.numbers = {"confirm": 0, "indication": 0}
        for name in "AB":
            watch = Watch(name, client.Address(), None, self.meter, lambda: self.now_s, self._delivered)  # type: ignore[arg-type]
            self.reports(name).say("status.", STATUS)
            SOCKETS[name, "users"].waiting.append([b"hb.counter", b"{}"])
            watch.join()
            watch.begin()
            self.watches[name] = watch

    def _delivered(self, station: str, digest: str, now_ns: int) -> None:
        self.delivered.append((station, digest))

    def reports(self, name: str) -> FakeSocket:
        return SOCKETS[name, "reports"]

    def sent(self, digest: str, number: int | None = None) -> None:
        self._told("A", "confirm", CONFIRM | {"digest": digest}, number)

    def received(self, digest: str, number: int | None = None) -> None:
        self._told("B", "indication", INDICATION | {"digest": digest}, number)

    def _told(self, name: str, kind: str, said: dict[str, Any], number: int | None) -> None:
        self.numbers[kind] = self.numbers[kind] + 1 if number is None else number
        self.reports(name).say(f"{kind}.cam.", said | {"sequence": self.numbers[kind]})
        self.watches[name].take()

    def status(self, name: str, **changes: Any) -> None:
        self.reports(name).say("status.", STATUS | changes)
        self.watches[name].take()

    def figures(self) -> dict[Fate, int]:
        for watch in self.watches.values():
            watch.look(self.now_s)
        self.meter.finish()
        return dict(self.meter.ways[WAY].whole.counts)


SOCKETS: dict[tuple[str, str], FakeSocket] = {}


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    made: list[FakeSocket] = []

    def subscribe(*_: object) -> FakeSocket:
        made.append(FakeSocket())
        order = [("A", "reports"), ("A", "users"), ("B", "reports"), ("B", "users"), ("C", "users")]
        SOCKETS[order[len(made) - 1]] = made[-1]
        return made[-1]

    monkeypatch.setattr(client, "subscribe", subscribe)
    yield Bench()
    SOCKETS.clear()


def test_what_both_say_is_counted(bench: Bench) -> None:
    bench.sent("a")
    bench.received("a")
    bench.sent("b")
    assert bench.figures() == {Fate.ARRIVED: 1, Fate.LOST: 1}


def test_indications_that_were_not_heard_may_have_been_it(bench: Bench) -> None:
    for digest in "abc":
        bench.sent(digest)
    bench.received("a", number=1)
    bench.received("c", number=3)
    assert bench.figures() == {Fate.ARRIVED: 2, Fate.UNSEEN: 1}
    assert bench.watches["B"].told()["missed_indications"] == 1


def test_a_status_tells_of_the_last_ones_that_were_not_heard(bench: Bench) -> None:
    bench.sent("a")
    bench.status("B", report={"confirms": 0, "indications": 1})
    assert bench.figures() == {Fate.UNSEEN: 1}


def test_of_a_station_that_is_silent_nobody_knows_what_it_received(bench: Bench) -> None:
    bench.sent("a")
    bench.now_s += SILENT_S + 1
    assert bench.figures() == {Fate.UNSEEN: 1}


def test_a_station_that_fell_silent_and_stays_so_is_told(bench: Bench) -> None:
    bench.now_s += 60.0
    assert any("silent for the last 60.0 s" in str(note) for note in bench.watches["B"].told()["notes"])  # type: ignore[attr-defined]


def test_ports_that_are_not_of_one_station_are_told(bench: Bench) -> None:
    bench.status("B", endpoint={"published": 100})
    assert any("belong to different stations" in str(note) for note in bench.watches["B"].told()["notes"])  # type: ignore[attr-defined]


def test_one_station_under_two_names_is_refused(bench: Bench) -> None:
    session = Session(bench.meter, TimeLine())
    session.watches = list(bench.watches.values())
    with pytest.raises(StationError, match="A and B are the same station"):
        session._check_others()


def test_nothing_is_judged_while_a_status_is_late(bench: Bench) -> None:
    watch = bench.watches["B"]
    heard_s = bench.now_s
    assert watch.judged_until(heard_s + 1.0) == heard_s + 1.0
    assert watch.judged_until(heard_s + 2.0) == heard_s
    assert watch.judged_until(heard_s + SILENT_S + 1) == heard_s + SILENT_S + 1


def test_a_station_that_was_started_anew_counts_from_the_beginning(bench: Bench) -> None:
    bench.received("a", number=40)
    bench.status("B", pid=8, report={"confirms": 0, "indications": 0})
    bench.received("b", number=1)
    told = bench.watches["B"].told()
    assert told["missed_indications"] == 39  # before it
    assert any("restarted once" in str(note) for note in told["notes"])  # type: ignore[attr-defined]


def test_a_station_of_a_container_that_was_started_anew_is_told_by_its_time(bench: Bench) -> None:
    bench.status("B", uptime_s=100.0)
    bench.status("B", uptime_s=1.0)
    assert bench.watches["B"].restarts == 1


def test_what_left_before_all_had_joined_is_not_measured(bench: Bench) -> None:
    bench.watches["A"]._is_measuring = False
    bench.sent("a")
    bench.watches["A"].begin()
    bench.received("a")
    assert bench.figures() == {Fate.STRANGE: 1}


def test_the_meters_own_messages_are_over_when_each_interface_has_said_so(bench: Bench) -> None:
    own = bench.watches["A"].own
    for label, outcome in ((f"{LABEL}/1", "accepted"), ("another", "accepted"), (f"{LABEL}/1", "sent")):
        assert not own.is_over(1)
        own.add({"label": label, "outcome": outcome, "interfaces": ["g5"]})
    assert own.is_over(1)
    own.add({"label": f"{LABEL}/2", "outcome": "refused"})
    assert own.is_over(2)


def test_what_was_refused_or_dropped_is_told_with_its_reason(bench: Bench) -> None:
    bench._told("A", "confirm", CONFIRM | {"outcome": "dropped", "reason": "expired"}, None)
    ((port, leaving),) = bench.meter.inside.leaving.items()
    assert (tuple(port), dict(leaving.not_sent)) == (("A", "g5"), {"expired": 1})
    assert bench.meter.inside.told("A") == 1


def test_what_leaves_after_the_end_is_not_measured(bench: Bench) -> None:
    bench.watches["A"].end()
    bench.sent("a")
    assert bench.figures() == {}


def test_what_is_sent_again_and_again_is_no_duplicate_before_and_after_it_is_measured(bench: Bench) -> None:
    watch, other = bench.watches["A"], bench.watches["B"]
    watch._is_measuring = False
    for turn in range(3):
        if turn == 1:
            watch.begin()
        if turn == 2:
            watch.end()
        for _ in range(10):
            bench.now_s += 0.05
            watch.heard_s = other.heard_s = bench.now_s
            bench.sent("a")
            bench.received("a")
    assert bench.figures() == {Fate.ARRIVED: 10, Fate.STRANGE: 20}


def test_what_leaves_in_confirms_that_were_not_heard_makes_no_duplicate(bench: Bench) -> None:
    for number in (1, 2, 3, 40, 41, 42):
        bench.now_s += 0.1
        bench.sent("a", number)
    for _ in range(10):
        bench.received("a")
    assert bench.figures() == {Fate.ARRIVED: 6, Fate.STRANGE: 4}
    assert bench.watches["A"].told()["missed_confirms"] == 36


def test_what_users_get_is_counted_by_type(bench: Bench) -> None:
    pdu = bytes([2, 2]) + bytes(40)
    users = SOCKETS["B", "users"]
    users.waiting.append([b"raw.", raw.build(pdu, 1_795_182_426_461_613_000, NO_RX_INFO)])
    users.waiting.append([b"v2x.cam.", pdu])
    bench.watches["B"].take()
    assert dict(bench.meter.inside.delivered["B"].types) == {"cam": 1}
    assert [station for station, _ in bench.delivered] == ["B"]


def test_of_a_busy_station_the_first_messages_of_each_second_are_looked_at(bench: Bench) -> None:
    users = SOCKETS["B", "users"]
    watch = bench.watches["B"]
    for second in range(3):
        users.waiting.extend([b"v2x.cam.", bytes([2, 2, *number.to_bytes(4, "big")]) * 8] for number in range(250))
        watch.take()
        bench.now_s += 1.0
        assert bench.meter.inside.delivered["B"].types["cam"] == (second + 1) * GLANCE
    shut, opened = (zmq.UNSUBSCRIBE, b""), (zmq.SUBSCRIBE, b"")
    assert users.asked == [shut, opened, shut, opened, shut]
    bench.status("B", endpoint={"published": 750})
    (note,) = (str(note) for note in watch.told()["notes"])  # type: ignore[attr-defined]
    assert f"{3 * GLANCE} of 750 messages to its users were read" in note


def test_what_a_station_gave_its_users_before_it_was_started_anew_counts(bench: Bench) -> None:
    users, watch = SOCKETS["B", "users"], bench.watches["B"]
    for published, uptime_s in ((250, 100.0), (20, 1.0)):
        users.waiting.extend([b"v2x.cam.", bytes([2, 2, *number.to_bytes(4, "big")])] for number in range(published))
        watch.take()
        bench.status("B", uptime_s=uptime_s, endpoint={"published": published})
        bench.now_s += 1.0
    assert any("120 of 270 messages to its users were read" in str(note) for note in watch.told()["notes"])  # type: ignore[attr-defined]


def test_each_message_is_looked_at_where_probes_are_on_their_way(bench: Bench) -> None:
    tap = Tap(None, client.Address(), is_whole=True)  # type: ignore[arg-type]
    tap.socket.waiting.extend([b"v2x.cam.", bytes([2, 2, *number.to_bytes(4, "big")])] for number in range(250))  # type: ignore[attr-defined]
    assert len(list(tap.take(0.0))) == 250
    assert not tap.is_part


@pytest.mark.parametrize(
    "frames", [[b"status."], [b"status.", b"{"], [b"", b"[]"], [b"indication.", b"{}"], [b"confirm.", b"{}"]]
)
def test_rubbish_harms_nobody(bench: Bench, frames: list[bytes]) -> None:
    bench.reports("A").waiting.append(frames)
    bench.watches["A"].take()
    assert bench.figures() == {}


def test_an_older_station_is_refused_with_a_remedy(bench: Bench) -> None:
    watch = bench.watches["A"]
    watch.status = {}
    bench.reports("A").say("status.", {key: value for key, value in STATUS.items() if key != "boot"})
    with pytest.raises(StationError, match=r"9\.9"):
        watch.join()


class Poller:
    """A tenth of a second, in which both stations say that they are there."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def poll(self, timeout: float) -> None:
        self._bench.now_s += 0.1
        for name in "AB":
            self._bench.status(name)


def test_a_signal_while_fates_are_counted_ends_a_measurement_with_all_of_them(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firmware.meter.session.registered", lambda watches: Poller(bench))
    session = Session(bench.meter, lambda: bench.now_s)  # type: ignore[arg-type]
    session.watches = list(bench.watches.values())
    add, signals = Spots.add, [signal.SIGINT]

    def added(spots: Spots, one: Settled) -> None:
        if signals:
            os.kill(os.getpid(), signals.pop())
        add(spots, one)

    monkeypatch.setattr(Spots, "add", added)
    for digest in "abc":
        bench.sent(digest)
        bench.received(digest)
    waits: list[float] = []
    with command._stopped_by_signals(session):
        session.run(None, lambda: None, lambda: waits.append(bench.now_s))
    assert bench.figures() == {Fate.ARRIVED: 3}
    assert (len(waits), session.is_cut) == (1, False)
