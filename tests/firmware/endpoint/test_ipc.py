"""Interface processes over ipc://: RawRxMessages come in, PDUs go out."""

import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
import zmq

from board.runtime.errors import InterfaceError
from drivers.contract import Can
from drivers.message import Outcome, RxInfo
from drivers.reason import Reason
from drivers.wire import raw
from firmware.config.tables import QueueOptions
from firmware.endpoint.ipc import RETRY_S, SETTLE_S, Ipc, IpcOptions
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface
from firmware.topics import Topics
from tests.firmware.doubles import CAM_PDU, NotingStation, pdu_of, request_of
from tests.said import tells
from tests.virtual import VirtualLoop

DENM = Topics().by_number[1]


class Bench:
    def __init__(self, loop: VirtualLoop, ipc_in: str, ipc_out: str) -> None:
        loop.patience_s = 0.05
        self.loop = loop
        self.context = zmq.Context()
        self.above = NotingStation()
        self.drops = Drops()
        self.ipc = Ipc(self.context, IpcOptions(ipc_in, ipc_out), Topics(), self.drops)
        self.interface = Interface("ipc", self.ipc, QueueOptions("ipc"), loop, self.above, Topics(), self.drops)
        self.sockets: list[zmq.Socket[bytes]] = []

    def process(self, kind: int, address: str, *topics: bytes) -> "zmq.Socket[bytes]":
        """An interface process: its end of one of the two sockets.

        topics  that a SUB subscribes to; they travel together, in the order of their octets. None: everything.
        """
        socket = self.context.socket(kind)
        socket.set(zmq.LINGER, 0)
        socket.set(zmq.RCVTIMEO, 2000)
        for topic in topics or ((b"",) if kind == zmq.SUB else ()):
            socket.subscribe(topic)
        socket.connect(address)
        self.sockets.append(socket)
        return socket

    def close(self) -> None:
        self.ipc.stop()
        for each in self.sockets:
            each.close(0)
        self.context.term()


@pytest.fixture
def bench(loop: VirtualLoop, tmp_path: Path) -> Iterator[Bench]:
    with closing(Bench(loop, f"ipc://{tmp_path}/v2x/in/0", f"ipc://{tmp_path}/v2x/out/0")) as bench:
        bench.ipc.start(bench.interface)
        yield bench


def sender(bench: Bench) -> "zmq.Socket[bytes]":
    """A process that is connected: a PUB loses what it sends before the subscription has travelled."""
    process = bench.process(zmq.XPUB, bench.ipc._options.ipc_in)
    for _ in range(200):
        assert bench.ipc._in is not None
        bench.ipc._in.ready()
        if process.poll(10):
            break
    assert process.recv() == b"\1"
    return process


def test_folders_that_are_not_there_are_made(bench: Bench, tmp_path: Path) -> None:
    assert (tmp_path / "v2x" / "in" / "0").is_socket()
    assert (tmp_path / "v2x" / "out" / "0").is_socket()


def test_a_rawrxmessage_comes_in_with_what_is_known_of_it(bench: Bench) -> None:
    rx = RxInfo(rssi_dbm=-71, source_mac=b"\1\2\3\4\5\6")
    sender(bench).send(raw.build(CAM_PDU, 1_795_182_426_461_613_000, rx))
    bench.loop.run_until(lambda: bool(bench.above.indications))
    (indication,) = bench.above.indications
    assert (indication.pdu, indication.received_ns) == (CAM_PDU, 1_795_182_426_461_613_000)
    assert (indication.rx.rssi_dbm, indication.rx.source_mac) == (-71, b"\1\2\3\4\5\6")


@pytest.mark.parametrize(
    ("frames", "reason"),
    [
        ([b""], Reason.RAW_FORMAT),
        ([b"rubbish"], Reason.RAW_FORMAT),
        ([b"raw.", raw.build(CAM_PDU, 0, RxInfo())], Reason.RAW_FORMAT),
        ([raw.build(CAM_PDU, 0, RxInfo())[:40]], Reason.RAW_FORMAT),
        ([raw.build(b"", 0, RxInfo())], Reason.EMPTY_PDU),
        ([raw.build(b"abc", 0, RxInfo())], Reason.SHORT_PDU),
    ],
)
def test_what_cannot_be_read_is_counted_and_the_next_passes(bench: Bench, frames: list[bytes], reason: Reason) -> None:
    process = sender(bench)
    process.send_multipart(frames)
    process.send(raw.build(CAM_PDU, 0, RxInfo()))
    bench.loop.run_until(lambda: bool(bench.above.indications))
    assert bench.drops.total("ipc", reason) == 1


def test_a_burst_beyond_one_batch_is_taken_whole(bench: Bench) -> None:
    process = sender(bench)
    for number in range(100):
        process.send(raw.build(pdu_of(2, number), 0, RxInfo()))
    bench.loop.run_until(lambda: len(bench.above.indications) == 100)


def subscriber(bench: Bench) -> "zmq.Socket[bytes]":
    """A process that is connected and takes everything."""
    process = bench.process(zmq.SUB, bench.ipc._options.ipc_out)
    bench.loop.run_until(lambda: bench.interface.is_up)
    return process


def test_a_request_goes_out_under_its_envelope(bench: Bench) -> None:
    process = subscriber(bench)
    bench.interface.outlet.submit(request_of(1))
    assert process.recv_multipart() == [b"v2x.cam.", CAM_PDU]
    assert bench.above.outcomes() == [(1, Outcome.SENT, None)]


def test_request_without_a_subscribed_process_does_not_count_as_sent(bench: Bench) -> None:
    assert not bench.interface.is_up
    assert tells(bench.interface.why, "no interface process", "subscribed")
    bench.interface.outlet.submit(request_of(1, deadline=bench.loop.now + 1.0))
    bench.loop.run_for(2.0)
    assert bench.above.outcomes() == [(1, Outcome.DROPPED, Reason.LINK_DOWN)]


def cam_process(bench: Bench) -> "zmq.Socket[bytes]":
    """A process that is connected and takes CAMs only."""
    process = bench.process(zmq.XSUB, bench.ipc._options.ipc_out)
    process.send(b"\1v2x.cam.")
    bench.loop.run_until(lambda: bench.interface.is_up)
    return process


def test_what_no_process_takes_is_not_sent_and_says_why_while_what_one_takes_is(bench: Bench) -> None:
    process = cam_process(bench)
    bench.interface.outlet.submit(request_of(1, pdu=pdu_of(1), kind=DENM))
    bench.interface.outlet.submit(request_of(2))
    bench.loop.run_until(lambda: bench.interface.outlet.is_empty)
    assert sorted(bench.above.outcomes()) == [
        (1, Outcome.DROPPED, Reason.NO_SUBSCRIBER),
        (2, Outcome.SENT, None),
    ]
    assert process.recv_multipart() == [b"v2x.cam.", CAM_PDU]
    assert bench.drops.total("ipc", Reason.NO_SUBSCRIBER) == 1


@pytest.mark.parametrize("prefix", [b"", b"v2x", b"v2x.", b"v2x.d", b"v2x.denm."])
def test_a_message_is_sent_to_a_process_that_takes_any_beginning_of_its_envelope(bench: Bench, prefix: bytes) -> None:
    process = cam_process(bench)
    process.send(b"\1" + prefix)
    # It stands in the socket before the next message, and nobody has read it yet.
    assert bench.ipc._out is not None
    assert bench.ipc._out._publisher._socket.poll(2000)
    bench.interface.outlet.submit(request_of(1, pdu=pdu_of(1), kind=DENM))
    assert bench.above.outcomes() == [(1, Outcome.SENT, None)]
    assert process.recv_multipart() == [b"v2x.denm.", pdu_of(1)]


def test_a_process_that_takes_only_what_is_longer_than_an_envelope_takes_nothing(bench: Bench) -> None:
    process = bench.process(zmq.XSUB, bench.ipc._options.ipc_out)
    process.send(b"\1v2x.cam.and")
    bench.loop.run_until(lambda: bench.interface.is_up)
    bench.interface.outlet.submit(request_of(1))
    bench.loop.run_until(lambda: bench.interface.outlet.is_empty)
    assert bench.above.outcomes() == [(1, Outcome.DROPPED, Reason.NO_SUBSCRIBER)]


def test_what_waited_is_sent_to_a_process_that_takes_its_type_a_moment_after_another(bench: Bench) -> None:
    bench.interface.outlet.submit(request_of(1, pdu=pdu_of(1), kind=DENM))
    process = cam_process(bench)
    assert bench.above.outcomes() == []
    process.send(b"\1v2x.denm.")
    assert bench.ipc._out is not None
    assert bench.ipc._out._publisher._socket.poll(2000)
    bench.loop.run_until(lambda: bool(bench.above.confirms))
    assert bench.above.outcomes() == [(1, Outcome.SENT, None)]
    assert process.recv_multipart() == [b"v2x.denm.", pdu_of(1)]


def test_what_waited_is_dropped_a_moment_after_a_process_came_that_does_not_take_its_type(bench: Bench) -> None:
    bench.interface.outlet.submit(request_of(1, pdu=pdu_of(1), kind=DENM))
    cam_process(bench)
    bench.loop.run_for(SETTLE_S)
    assert bench.above.outcomes() == [(1, Outcome.DROPPED, Reason.NO_SUBSCRIBER)]


def test_what_the_last_process_that_took_it_left_is_not_sent(bench: Bench) -> None:
    first = cam_process(bench)
    second = cam_process(bench)
    second.send(b"\1v2x.denm.")
    bench.loop.run_until(lambda: bench.ipc._out is not None and bench.ipc._out._publisher.wants(b"v2x.denm."))
    second.close(0)
    bench.loop.run_until(lambda: bench.ipc._out is not None and not bench.ipc._out._publisher.wants(b"v2x.denm."))
    bench.interface.outlet.submit(request_of(1, pdu=pdu_of(1), kind=DENM))
    bench.interface.outlet.submit(request_of(2))
    bench.loop.run_until(lambda: bench.interface.outlet.is_empty)
    assert sorted(bench.above.outcomes()) == [(1, Outcome.DROPPED, Reason.NO_SUBSCRIBER), (2, Outcome.SENT, None)]
    assert first.recv_multipart() == [b"v2x.cam.", CAM_PDU]


def test_what_waited_for_a_process_leaves_when_it_comes(bench: Bench) -> None:
    bench.interface.outlet.submit(request_of(1))
    process = subscriber(bench)
    assert process.recv_multipart() == [b"v2x.cam.", CAM_PDU]
    assert bench.above.outcomes() == [(1, Outcome.SENT, None)]


def test_the_link_goes_down_with_the_last_process(bench: Bench) -> None:
    first, second = subscriber(bench), subscriber(bench)
    first.close(0)
    second.close(0)
    bench.loop.run_until(lambda: not bench.interface.is_up)


def test_a_process_that_takes_no_envelope_makes_no_link(bench: Bench) -> None:
    process = bench.process(zmq.XSUB, bench.ipc._options.ipc_out)
    process.send(b"\1other.")
    process.send(b"rubbish")
    bench.loop.run_for(0.5)
    assert not bench.interface.is_up
    process.send(b"\1v2x.cam.")
    bench.loop.run_until(lambda: bench.interface.is_up)


def test_what_a_process_brings_passes_while_the_link_is_down(bench: Bench) -> None:
    sender(bench).send(raw.build(CAM_PDU, 0, RxInfo()))
    bench.loop.run_until(lambda: bool(bench.above.indications))
    assert not bench.interface.is_up


def test_a_process_that_does_not_keep_up_makes_requests_wait_and_none_is_lost(bench: Bench) -> None:
    process = subscriber(bench)
    count = 0
    while bench.interface.outlet.is_empty:
        count += 1
        bench.interface.outlet.submit(request_of(count))
        assert count < 100_000
    assert bench.drops.total("ipc_out", Reason.SUBSCRIBER_SLOW) == 0
    for number in range(count):
        assert process.recv_multipart() == [b"v2x.cam.", CAM_PDU]
        if number % 1000 == 0:
            bench.loop.run_for(RETRY_S)
    assert bench.above.outcomes() == [(number, Outcome.SENT, None) for number in range(1, count + 1)]


def test_a_stop_while_requests_wait_leaves_no_timer_that_acts(bench: Bench) -> None:
    subscriber(bench)
    while bench.interface.outlet.is_empty:
        bench.interface.outlet.submit(request_of())
    bench.ipc.stop()
    bench.loop.run_for(1.0)
    assert bench.interface.outlet.length == 1


def test_a_way_that_is_off_is_not_opened(loop: VirtualLoop, tmp_path: Path) -> None:
    with closing(Bench(loop, f"ipc://{tmp_path}/in", "")) as bench:
        bench.ipc.start(bench.interface)
        assert bench.interface.is_up
        assert Can.TRANSMIT not in bench.ipc.capabilities.can
        assert not bench.interface.can_transmit
    with closing(Bench(loop, "", f"ipc://{tmp_path}/out")) as bench:
        bench.ipc.start(bench.interface)
        assert bench.interface.can_transmit
        assert not bench.interface.is_up


@pytest.mark.parametrize("taken", ["in", "out"])
def test_a_path_that_cannot_be_had_names_the_option_and_leaves_nothing_open(
    loop: VirtualLoop, tmp_path: Path, taken: str
) -> None:
    (tmp_path / "file").write_text("")
    good, bad = f"ipc://{tmp_path}/good", f"ipc://{tmp_path}/file/below/0"
    ways = (bad, good) if taken == "in" else (good, bad)
    with closing(Bench(loop, *ways)) as bench:
        for _ in range(3):  # as the supervisor does
            with pytest.raises(InterfaceError, match=rf"endpoint\.ipc_{taken}: cannot make"):
                bench.ipc.start(bench.interface)
            assert loop._sources == {}
            assert (bench.ipc._in, bench.ipc._out) == (None, None)


@pytest.mark.parametrize("taken", ["in", "out"])
def test_a_path_of_a_station_that_runs_is_refused_until_that_has_stopped(
    bench: Bench, loop: VirtualLoop, tmp_path: Path, taken: str
) -> None:
    theirs = getattr(bench.ipc._options, f"ipc_{taken}")
    own = f"ipc://{tmp_path}/own"
    with closing(Bench(loop, *((theirs, own) if taken == "in" else (own, theirs)))) as second:
        for _ in range(3):  # as the supervisor does
            with pytest.raises(InterfaceError, match=rf"endpoint\.ipc_{taken}: .*/v2x/{taken}/0 .*another") as caught:
                second.ipc.start(second.interface)
            assert "its own path" in caught.value.hint
        # The first has lost nothing.
        sender(bench).send(raw.build(CAM_PDU, 0, RxInfo()))
        loop.run_until(lambda: bool(bench.above.indications))
        subscriber(bench)
        bench.ipc.stop()
        second.ipc.start(second.interface)
        subscriber(second)


def test_what_a_dead_station_left_is_no_obstacle(loop: VirtualLoop, tmp_path: Path) -> None:
    ways = (tmp_path / "in", tmp_path / "out")
    for way in ways:
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(str(way))
        way.with_name(way.name + ".lock").touch()
    with closing(Bench(loop, *(f"ipc://{way}" for way in ways))) as bench:
        bench.ipc.start(bench.interface)
        sender(bench)
        subscriber(bench)


def test_a_name_without_a_file_needs_no_lock(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with closing(Bench(loop, "", f"ipc://@{tmp_path}")) as bench:
        bench.ipc.start(bench.interface)
        subscriber(bench)
        assert list(tmp_path.iterdir()) == []
        # The kernel knows these names.
        with closing(Bench(loop, "", f"ipc://@{tmp_path}")) as second, pytest.raises(InterfaceError, match="ipc_out"):
            second.ipc.start(second.interface)


def test_a_lock_that_cannot_be_had_names_the_option_and_the_file(loop: VirtualLoop, tmp_path: Path) -> None:
    (tmp_path / "in.lock").mkdir()
    refusal = pytest.raises(InterfaceError, match=r"endpoint\.ipc_in: cannot lock .*/in\.lock: Is a directory")
    with closing(Bench(loop, f"ipc://{tmp_path}/in", "")) as bench, refusal:
        bench.ipc.start(bench.interface)


def test_it_may_be_stopped_twice_and_started_again(bench: Bench) -> None:
    incoming = bench.ipc._in
    bench.ipc.stop()
    bench.ipc.stop()
    assert incoming is not None
    incoming.ready()
    bench.ipc.start(bench.interface)
    sender(bench).send(raw.build(CAM_PDU, 0, RxInfo()))
    bench.loop.run_until(lambda: bool(bench.above.indications))
