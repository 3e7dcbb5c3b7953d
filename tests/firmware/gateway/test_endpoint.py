"""Sockets of the gateway: receiving thread, refusing sender."""

import json
import threading
import time
from collections.abc import Callable, Iterator

import captain_messages
import pytest
import zmq

from drivers.message import RxInfo
from drivers.wire import raw
from firmware.gateway.captain_gateway.captain_gateway import endpoint
from firmware.gateway.captain_gateway.captain_gateway.endpoint import Address, Receiving, Sending
from firmware.gateway.captain_gateway.captain_gateway.errors import RefusedError
from firmware.gateway.captain_gateway.captain_gateway.pairing import Arrival, How, Joining, Key, RawReader
from tests.broker.proxy import Proxy
from tests.firmware.gateway.real import CAM
from tests.system.ports import Ports

PATIENCE_S = 10.0  # reached only by a test that fails
HOST = "127.0.0.1"


class Heard:
    """What the thread has told."""

    def __init__(self) -> None:
        self.joining = Joining(RawReader(captain_messages))
        self.arrivals: list[Arrival] = []
        self.indications: list[tuple[Key, How]] = []
        self.reports: list[tuple[str, dict[str, object]]] = []
        self.presence: list[bool] = []
        self.threads: set[str] = set()

    def arrived(self, arrival: Arrival) -> None:
        self.threads.add(threading.current_thread().name)
        self.arrivals.append(arrival)

    def indicated(self, key: Key, how: How) -> None:
        self.indications.append((key, how))

    def reported(self, topic: str, told: dict[str, object]) -> None:
        self.reports.append((topic, told))

    def present(self, is_there: bool) -> None:
        self.presence.append(is_there)

    def passed(self) -> bool:
        return False


class Station:
    """The sockets of one."""

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]") -> None:
        self.users, self.report, self.pull = (
            context.socket(zmq.XPUB),
            context.socket(zmq.XPUB),
            context.socket(zmq.PULL),
        )
        ports = [one.bind_to_random_port(f"tcp://{HOST}") for one in (self.users, self.report, self.pull)]
        self.address = Address(HOST, ports[0], ports[2], 0, ports[1])

    def wait_for_subscriptions(self) -> None:
        topics = b"soon.", b"indication.", b"confirm.", b"status.", b"time."
        for socket, wanted in ((self.users, {b""}), (self.report, set(topics))):
            while wanted:
                assert socket.poll(PATIENCE_S * 1000), f"not subscribed to: {wanted}"
                wanted.remove(socket.recv()[1:])


@pytest.fixture
def context() -> Iterator["zmq.Context[zmq.Socket[bytes]]"]:
    made: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    yield made
    made.destroy(linger=0)


@pytest.fixture
def station(context):
    return Station(context)


@pytest.fixture
def heard(context, station):
    made = Heard()
    thread = Receiving(context, station.address, made.joining, made)
    thread.start()
    station.wait_for_subscriptions()
    yield made
    thread.end()
    assert thread.error is None


def until(holds: Callable[[], object]) -> None:
    ends = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < ends, "it never came to hold"
        time.sleep(0.002)


def test_what_the_station_sends_is_told_in_the_thread_that_receives(station, heard):
    station.users.send_multipart([b"raw.", raw.build(CAM, 5_000_000_000, RxInfo(rssi_dbm=-71))])
    station.users.send_multipart([b"v2x.cam.", CAM])
    until(lambda: heard.arrivals)
    [arrival] = heard.arrivals
    assert (arrival.type, arrival.pdu, arrival.reception.rssi_dbm) == ("cam", CAM, -71)
    assert heard.threads == {"receiving"}
    until(lambda: heard.presence)
    assert heard.presence == [True]


def test_reports_and_indications_are_told_and_rubbish_is_counted(station, heard):
    told = {"digest": "00" * 8, "interface": "g5", "received_ns": 5000, "btp_port": 2001, "source": ""}
    station.report.send_multipart([b"status.", b"{"])
    station.report.send_multipart([b"status.", b"[]"])
    station.report.send_multipart([b"status."])
    station.report.send_multipart([b"indication.cam.", b"{}"])
    station.report.send_multipart([b"indication.cam.", json.dumps(told).encode()])
    station.report.send_multipart([b"status.", b'{"station": "x"}'])
    until(lambda: heard.reports)
    assert heard.reports == [("status.", {"station": "x"})]
    assert heard.indications == [((bytes(8), 5), How("g5", 2001, ""))]
    assert (heard.joining.rubbish, heard.joining.sample) == (4, b"{}")


def test_a_burst_is_told_whole(station, heard):
    for number in range(1000):
        station.users.send_multipart([b"v2x.cam.", number.to_bytes(2, "big")])
    until(lambda: len(heard.arrivals) == 1000)
    assert [int.from_bytes(one.pdu, "big") for one in heard.arrivals] == list(range(1000))


def test_a_station_that_falls_silent_is_told_once_and_so_is_its_return(context, station, monkeypatch):
    monkeypatch.setattr(endpoint, "SILENT_S", 0.2)
    monkeypatch.setattr(endpoint, "IDLE_MS", 20)
    made = Heard()
    thread = Receiving(context, station.address, Joining(RawReader(captain_messages)), made)
    thread.start()
    station.wait_for_subscriptions()
    until(lambda: made.presence)
    station.users.send_multipart([b"hb.counter", b'{"heartbeat_counter": 1}'])
    until(lambda: len(made.presence) == 3)
    thread.end()
    assert made.presence == [False, True, False]


@pytest.fixture
def lines(station, monkeypatch) -> Iterator[dict[str, Proxy]]:
    """To each port of the station; their ends look after each other often."""
    monkeypatch.setattr(endpoint, "HEARTBEAT_MS", 100)
    monkeypatch.setattr(endpoint, "HEARTBEAT_TIMEOUT_MS", 500)
    with (
        Proxy(station.address.to_users) as users,
        Proxy(station.address.report) as report,
        Proxy(station.address.pull) as pull,
    ):
        yield {"to_users": users, "report": report, "pull": pull}


def test_lines_that_swallow_everything_are_noticed_and_replaced(context, station, lines):
    address = station.address._replace(**{name: line.port for name, line in lines.items()})
    made = Heard()
    thread = Receiving(context, address, Joining(RawReader(captain_messages)), made)
    thread.start()
    sending = Sending(context, address)
    station.wait_for_subscriptions()
    until(lambda: sent(sending, {}))
    for line in lines.values():
        line.go_dark()  # as when the other machine loses its power: no end of the connection is told
    for line in lines.values():
        until(lambda line=line: line.accepted > 1)
        line.light()
        line.cut()

    def arrives() -> bool:
        station.users.send_multipart([b"v2x.cam.", CAM])
        station.report.send_multipart([b"status.", b"{}"])
        sent(sending, {"priority": 0})
        time.sleep(0.005)
        return bool(made.arrivals and made.reports and station.pull.poll(0))

    until(arrives)
    thread.end()
    sending.close()


def test_a_bug_in_who_listens_ends_the_thread_and_is_kept_for_the_node(context, station):
    class Broken(Heard):
        def arrived(self, arrival: Arrival) -> None:
            raise ZeroDivisionError

    thread = Receiving(context, station.address, Joining(RawReader(captain_messages)), Broken())
    thread.start()
    station.wait_for_subscriptions()
    station.users.send_multipart([b"v2x.cam.", CAM])
    until(lambda: not thread.is_alive())
    assert isinstance(thread.error, ZeroDivisionError)
    thread.end()


def sent(sending: Sending, options: dict[str, object]) -> bool:
    try:
        sending.send(CAM, options)
    except RefusedError:
        return False
    return True


def test_a_message_goes_to_the_pull_with_its_options(context, station):
    sending = Sending(context, station.address)
    until(lambda: sent(sending, {"priority": 0}))
    assert station.pull.poll(PATIENCE_S * 1000)
    assert station.pull.recv_multipart() == [b"v2x.", CAM, b'{"priority": 0}']
    assert sent(sending, {})
    assert station.pull.recv_multipart() == [b"v2x.", CAM]
    sending.close()


def test_where_no_station_is_a_message_is_refused_at_once_and_not_kept(context):
    held = Ports()  # a port where nobody listens
    port = held.take()
    sending = Sending(context, Address(HOST, 1, port, 2, 0))
    with pytest.raises(RefusedError, match=f"no station takes messages at tcp://{HOST}:{port}") as refused:
        sending.send(CAM, {})
    assert refused.value.cause == "no-station"
    sending.close()
    held.release()


@pytest.mark.parametrize("has_pull", [True, False])
def test_while_the_station_is_silent_a_message_is_refused_though_its_port_is_open(context, station, has_pull):
    pull = station.address.pull
    sending = Sending(context, station.address if has_pull else Address(HOST, 1, 0, pull, 0))
    until(lambda: sent(sending, {}))
    sending.is_silent = True
    with pytest.raises(RefusedError, match=f"the station at tcp://{HOST}:{pull} is silent") as refused:
        sending.send(CAM, {})
    assert refused.value.cause == "no-station"
    sending.is_silent = False
    assert sent(sending, {})
    sending.close()


def test_what_a_station_does_not_take_is_kept_for_about_a_second(context):
    pull = context.socket(zmq.PULL)
    pull.set(zmq.RCVHWM, 1)
    port = pull.bind_to_random_port(f"tcp://{HOST}")
    sending = Sending(context, Address(HOST, 1, port, 2, 0))
    until(lambda: sent(sending, {}))
    large = bytes(100_000)  # so that the kernel's buffers hold few
    taken = 0
    while taken < 10_000:
        try:
            sending.send(large, {})
        except RefusedError:
            break
        taken += 1
    assert taken < 1_500
    sending.close()
    pull.close()


def test_a_box_without_a_pull_gets_two_frames_by_its_first_port(context):
    users = context.socket(zmq.XSUB)
    port = users.bind_to_random_port(f"tcp://{HOST}")
    users.send(b"\1")
    sending = Sending(context, Address(HOST, 1, 0, port, 0))

    def arrives() -> bool:
        sending.send(CAM, {"priority": 0})
        return bool(users.poll(10))

    until(arrives)
    assert users.recv_multipart() == [b"v2x.", CAM]
    sending.close()
    users.close()


def test_an_address_of_version_six_is_written_in_brackets():
    assert Address("::1", 1, 2, 3, 4).url(5) == "tcp://[::1]:5"
