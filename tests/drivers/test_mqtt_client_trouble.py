"""The process with the MQTT client at brokers and networks that misbehave: bounded, explained, and no busy loop."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from drivers import mqtt_connector
from drivers.mqtt_client import Process
from drivers.mqtt_connector import MOST_HANGING, SEND_BUFFER, Connector
from drivers.reason import Reason
from tests.broker import mute
from tests.broker.bad import FullBacklog, Listener, closing_after, saying, silent
from tests.broker.mute import Mute, publication
from tests.drivers.mqtt_station import CAM, DENM, Station, settings, written

Start = Callable[..., Station]

CONNACK = bytes.fromhex("2003000000")
SUBACK = bytes.fromhex("900400010001")
WILL = """
name = "will"
publish = []
subscribe = []
status = { topic = "s", lost = "gone", retain = true }
"""


@pytest.fixture
def turns(monkeypatch) -> list[int]:
    """How often each loop has turned."""
    counted: list[int] = []
    wait = Process._wait

    def count(process: Process) -> set[int]:
        counted.append(id(process))
        return wait(process)

    monkeypatch.setattr(Process, "_wait", count)
    return counted


@pytest.fixture
def start(turns) -> Iterator[Start]:
    made: list[Station] = []

    def start(port: int, **how) -> Station:
        made.append(Station(settings(f"mqtt://127.0.0.1:{port}", **how)))
        return made[-1]

    before = time.monotonic()
    yield start
    for one in made:
        one.close()
    # 1000 a second is what a loop needs that carries 500 messages; one that is busy for nothing turns 100,000 times.
    assert len(turns) < 200 + 1000 * (time.monotonic() - before), "a busy loop"


def idles(station: Station, seconds: float, turns: list[int]) -> None:
    """Nothing happens, and nothing is done."""
    turns.clear()
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        station.read(left)
    assert len(turns) < 30 * (1 + seconds), turns


# Networks.


def test_an_address_that_answers_no_syn_is_named(start, turns):
    with FullBacklog() as full:
        station = start(full.port, connect_s=0.6, first_delay_s=9.0)
        station.down(f"mqtt://127.0.0.1:{full.port}: no answer to SYN from 127.0.0.1 within 0.6 s")
        idles(station, 0.3, turns)


def test_a_port_where_nobody_listens_is_named(start):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    start(port).down(f"mqtt://127.0.0.1:{port}: 127.0.0.1: refuses the connection; no broker listens there")


def test_a_name_that_is_none_is_told(monkeypatch, start):
    def unknown(*_, **__):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(mqtt_connector.socket, "getaddrinfo", unknown)
    start(1).down("there is no host of this name; correct the host in url")


@pytest.mark.parametrize("host", ["x" * 64, "a..b"])
def test_a_name_that_cannot_be_one_is_told(turns, host):
    station = Station(settings(f"mqtt://{host}"))
    station.down(f"mqtt://{host}:1883: there is no host of this name")
    station.close()


def test_a_name_server_that_hangs_stops_nothing_and_few_threads_wait_for_it(monkeypatch, start, turns):
    release = threading.Event()

    def hang(*_, **__):
        release.wait(20.0)
        raise socket.gaierror(socket.EAI_AGAIN, "again")

    monkeypatch.setattr(mqtt_connector.socket, "getaddrinfo", hang)
    before = set(threading.enumerate())
    try:
        station = start(1, connect_s=0.1)
        station.down("no answer from the name server within 0.1 s")
        station.send(1, lifetime=0.2)
        station.until(lambda: station.sent)
        assert station.sent[1][0] is Reason.EXPIRED
        station.down(f"{MOST_HANGING} look-ups of its name hang")
        waiting = set(threading.enumerate()) - before
        assert len(waiting) <= 1 + MOST_HANGING
    finally:
        release.set()
    monkeypatch.undo()
    for one in waiting:
        one.join(5.0)
    assert Connector._hanging == 0
    with Mute() as broker:
        start(broker.port).up()


def test_a_device_that_is_not_there_is_named(start):
    with Mute() as broker:
        start(broker.port, device="wwan9").down("device wwan9: No such device; `ip -brief link` lists them")


def test_a_device_that_is_there_is_used(start):
    with Mute() as broker:
        start(broker.port, device="lo").up()


def test_another_address_of_the_name_is_tried_when_one_refuses(monkeypatch, start):
    with Mute() as broker:
        both = [(socket.AF_INET, 1, 6, "", (host, broker.port)) for host in ("127.0.0.2", "127.0.0.1")]
        monkeypatch.setattr(mqtt_connector.socket, "getaddrinfo", lambda *_, **__: both)
        start(broker.port).up()


# Brokers that close.


@pytest.mark.parametrize("after_s", [0.0, 0.05])
def test_one_that_closes_each_connection_is_asked_ever_less(start, after_s):
    with Listener(closing_after(after_s)) as listener:
        station = start(listener.port, first_delay_s=0.05, longest_delay_s=30.0)
        station.down("before CONNACK; if it wants TLS, write mqtts:// in url")
        end = time.monotonic() + 1.0
        while (left := end - time.monotonic()) > 0:
            station.read(left)
        assert 2 <= listener.accepted <= 7
        assert len(station.states) == 2  # and the same is told once


def test_one_that_closes_after_its_connack_has_stopped_or_knows_another_client_of_the_name(start):
    def moment(line: socket.socket, _over) -> None:
        line.recv(1000)
        line.sendall(CONNACK)
        line.recv(1000)

    with Listener(moment) as listener:
        words = start(listener.port).down("soon after CONNACK")
    assert words.endswith("it was stopped, or another client has the same client_id; its log says which")


def test_one_that_ends_each_session_after_a_moment_is_asked_ever_less(start):
    def moment(line: socket.socket, _over) -> None:
        line.recv(1000)
        line.sendall(CONNACK)
        line.recv(1000)
        line.sendall(SUBACK + bytes.fromhex("e0028b00"))

    with Listener(moment) as listener:
        station = start(listener.port, first_delay_s=0.05, longest_delay_s=30.0, profile="raw")
        station.until(lambda: any("ends the connection: Server shutting down" in why for _, why in station.states))
        end = time.monotonic() + 1.0
        while (left := end - time.monotonic()) > 0:
            station.read(left)
        assert 2 <= listener.accepted <= 7


def test_a_broker_says_why_it_ends_a_connection(start):
    with Mute() as broker:
        station = start(broker.port).up()
        broker.throw(bytes.fromhex("e00c8e0a1f0007") + b"another")
        station.down("ends the connection: Session taken over (another); another client has the same client_id")


# Brokers that acknowledge nothing.


def test_one_that_accepts_and_says_nothing_is_given_up(start, turns):
    with Listener(silent) as listener:
        station = start(listener.port, connect_s=0.3, first_delay_s=9.0)
        station.down("no CONNACK within 0.3 s")
        idles(station, 0.3, turns)


@pytest.mark.parametrize(
    ("kind", "words"), [(mute.CONNACK, "no CONNACK within 0.3 s"), (mute.SUBACK, "no SUBACK within 0.3 s")]
)
def test_one_that_leaves_out_an_acknowledgement_is_given_up(start, kind, words):
    with Mute(frozenset({kind})) as broker:
        start(broker.port, connect_s=0.3).down(words)


def test_one_that_never_acknowledges_a_message_is_given_up_and_the_message_expires(start, turns):
    with Mute(frozenset({mute.PUBACK})) as broker:
        station = start(broker.port, keep_alive_s=1, profile="raw").up()
        station.send(1, lifetime=0.3)
        station.until(lambda: station.sent)
        assert station.sent[1][0] is Reason.EXPIRED
        station.down("no PUBACK within 2 s")


def test_one_that_does_not_answer_to_ping_is_given_up(start):
    with Mute(frozenset({mute.PINGRESP})) as broker:
        start(broker.port, keep_alive_s=1).up().down("does not answer to PINGREQ")


def test_one_that_stops_reading_is_given_up_and_every_request_is_answered(start):
    with Mute(reads=1) as broker:
        station = start(broker.port, keep_alive_s=1, max_in_flight=20, qos=0, profile="raw").up()
        for number in range(20):
            station.send(number, CAM + bytes(1400), lifetime=1.0)
        station.until(lambda: len(station.sent) == 20)
        station.down(f"mqtt://127.0.0.1:{broker.port}: ")


DEAF_BUFFER = 4096


class Deaf:
    """A broker that accepts and subscribes, and reads no more before it is told to; then until nothing comes."""

    def __init__(self) -> None:
        self.read = bytearray()
        self._reads, self._has_read = threading.Event(), threading.Event()

    def __call__(self, line: socket.socket, over: threading.Event) -> None:
        line.recv(1000)
        line.sendall(CONNACK)
        line.recv(1000)
        line.sendall(SUBACK)
        self._reads.wait()
        line.settimeout(0.3)
        with contextlib.suppress(TimeoutError):
            while octets := line.recv(65536):
                self.read.extend(octets)
        self._has_read.set()

    def read_on(self) -> None:
        self._reads.set()
        assert self._has_read.wait(5.0)


@pytest.mark.parametrize("qos", [0, 1])
def test_what_was_told_expired_is_not_sent_when_the_broker_reads_again(start, qos):
    deaf = Deaf()
    with Listener(deaf) as listener:
        listener._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, DEAF_BUFFER)  # of what it accepts, too
        station = start(listener.port, profile="raw", qos=qos, max_in_flight=50, stall_s=60.0).up()
        for number in range(50):
            station.send(number, CAM + bytes(1400), lifetime=0.3)
        station.until(lambda: len(station.sent) == 50)
        deaf.read_on()
        assert Reason.EXPIRED in {reason for reason, _ in station.sent.values()}
        in_kernels = (2 * DEAF_BUFFER + 2 * SEND_BUFFER) // 1400 + 1
        assert deaf.read.count(CAM) <= in_kernels


def test_what_the_socket_has_not_taken_in_its_lifetime_never_leaves(start):
    deaf = Deaf()
    with Listener(deaf) as listener:
        listener._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, DEAF_BUFFER)  # of what it accepts, too
        station = start(listener.port, profile="raw", qos=0, max_in_flight=500, stall_s=60.0).up()
        for number in range(500):
            station.send(number, CAM + bytes(50), lifetime=0.3)
        station.until(lambda: len(station.sent) == 500)
        deaf.read_on()
        written = sum(reason is None for reason, _ in station.sent.values())
        assert deaf.read.count(CAM) == written


def test_one_that_reads_no_acknowledgements_is_not_read_from_without_end(start, turns):
    """It sends what has to be acknowledged and reads nothing: what waits for it stays bounded."""

    def flood(line: socket.socket, over: threading.Event) -> None:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        line.recv(1000)
        line.sendall(CONNACK)
        line.recv(1000)
        line.sendall(SUBACK)
        line.settimeout(0.3)
        sent = 0
        while not over.is_set() and sent < 1_000_000:
            try:
                line.sendall(publication("v2x/cam", CAM, number=1 + sent % 60_000))
            except TimeoutError:
                break
            sent += 1
        counted.append(sent)
        over.wait()

    counted: list[int] = []
    with Listener(flood) as listener:
        station = start(listener.port, profile="raw", keep_alive_s=20).up()
        station.until(lambda: bool(counted), 30.0)
        assert counted[0] < 1_000_000


def test_a_keep_alive_that_the_broker_assigns_is_kept(start):
    def strict(line: socket.socket, over: threading.Event) -> None:
        line.recv(1000)
        line.sendall(bytes.fromhex("2006000003130001"))  # Server Keep Alive 1 s
        while octets := line.recv(1000):
            heard.append((time.monotonic(), octets))
            line.sendall(SUBACK if octets[0] >> 4 == mute.SUBSCRIBE else bytes.fromhex("d000"))

    heard: list[tuple[float, bytes]] = []
    with Listener(strict) as listener:
        station = start(listener.port, keep_alive_s=600, profile="raw").up()
        station.until(lambda: any(octets == bytes.fromhex("c000") for _, octets in heard))


# Brokers that refuse.


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x84, 'Unsupported protocol version; set version = "3.1.1"'),
        (0x85, "Client identifier not valid; set another client_id"),
        (0x86, "Bad user name or password; correct username and password_file"),
        (0x87, "Not authorized; correct username and password_file"),
        (0x88, "Server unavailable"),
        (0x8A, "Banned; ask who runs the broker"),
        (0x9F, "Connection rate exceeded"),
    ],
)
def test_a_refused_connection_is_named_with_what_to_do(start, code, words):
    with Mute(connack=code) as broker:
        start(broker.port).down(f"mqtt://127.0.0.1:{broker.port}: refuses the connection: {words}")


@pytest.mark.parametrize(
    ("code", "words"),
    [(1, "Unsupported protocol version"), (2, "Client identifier not valid"), (4, "Bad user name"), (5, "Not auth")],
)
def test_a_refused_connection_of_3_1_1_is_named(start, code, words):
    with Mute(connack=code) as broker:
        start(broker.port, version="3.1.1").down(f"refuses the connection: {words}")


@pytest.mark.parametrize(
    ("code", "flags"),
    [(0x9A, [0b101100, 0b001100]), (0x9B, [0b101100, 0b100100])],  # will, its QoS and retain: MQTT 5.0, 3.1.2.3
)
def test_a_last_will_that_the_broker_cannot_keep_is_made_smaller(start, tmp_path, code, flags):
    profile = written(tmp_path / "will.toml", WILL)
    with Mute(connack=code) as broker:
        station = start(broker.port, profile=profile)
        seen = []
        for _ in flags:
            station.read(0.2)
            seen.append(broker.next(mute.CONNECT).body[7] & 0b111100)
        assert seen == flags


def test_a_broker_of_3_1_1_that_is_spoken_to_in_5_is_named(start):
    with Listener(answering(bytes.fromhex("20020001"))) as listener:
        start(listener.port).down("3.1.1")


def test_refused_subscriptions_leave_sending_possible(start):
    with Mute(suback=0x87) as broker:
        station = start(broker.port, profile="raw").up()
        assert "connected, but refuses subscription v2x/+: Not authorized" in station.why
        station.send(1)
        station.until(lambda: station.sent)
        assert station.sent[1] == (None, "")


def test_a_refused_message_failed_in_the_brokers_words(start):
    with Mute(puback=0x97) as broker:
        station = start(broker.port, profile="raw").up()
        station.send(1)
        station.until(lambda: station.sent)
        assert station.sent[1] == (
            Reason.SEND_FAILED,
            f"mqtt://127.0.0.1:{broker.port}: refuses it: Quota exceeded; the broker has enough of this client",
        )
        assert station.is_up


def test_a_broker_that_takes_one_message_at_a_time(start):
    def one_by_one(line: socket.socket, over: threading.Event) -> None:
        line.recv(1000)
        line.sendall(bytes.fromhex("2006000003210001"))  # Receive Maximum 1
        line.recv(1000)
        line.sendall(SUBACK)
        while octets := line.recv(10_000):
            seen.append(octets.count(CAM))
            number = octets[octets.index(b"v2x/cam") + 7 :][:2]
            time.sleep(0.01)
            line.sendall(bytes((0x40, 2)) + number)

    seen: list[int] = []
    with Listener(one_by_one) as listener:
        station = start(listener.port, profile="raw").up()
        for number in range(10):
            station.send(number)
        station.until(lambda: len(station.sent) == 10)
    assert seen == [1] * 10


# Rubbish.


def answering(octets: bytes, more: bytes = b"") -> Callable[[socket.socket, threading.Event], None]:
    """A broker that answers CONNECT and SUBSCRIBE in such octets."""

    def serve(line: socket.socket, _over: threading.Event) -> None:
        line.recv(1000)
        line.sendall(octets)
        if more:
            line.recv(1000)
            line.sendall(more)
        while line.recv(1000):
            pass

    return serve


@pytest.mark.parametrize(
    ("octets", "words"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "no MQTT: b'HTTP/1.1'; correct host and port in url"),
        (b"\x15\x03\x03\x00\x02\x02\x28", "speaks TLS at this port; write mqtts:// in url"),
        (b"\x20\xff\xff\xff\xff\xff", "length has more than 4 octets"),
        (b"\x20\x00", "no MQTT"),
        (b"\x20\x03\x00\x00\xff", "no MQTT"),
        (b"\x34\x00", "no MQTT"),
    ],
)
def test_what_is_no_broker_is_named(start, octets, words):
    with Listener(saying(octets)) as listener:
        start(listener.port, first_delay_s=5.0, longest_delay_s=5.0).down(f":{listener.port}: ", words)


@pytest.mark.parametrize(
    "octets",
    [b"\x00\x00", b"\x10\x00", b"\xf0\x00", b"\x36\x05\x00\x01t\x00\x01", b"\x40\x00", b"\x90\x01\x00",
     b"\x30\x01\x00", b"\x30\x04\x00\x09ab", b"\x30\x08\x00\x01t\x03\x26\x00\x01\x61", b"\xe0\x02\x05\x50"],
)  # fmt: skip
def test_a_broken_packet_ends_the_connection_and_not_the_process(start, octets):
    with Listener(answering(CONNACK, SUBACK + octets)) as listener:
        station = start(listener.port, profile="raw", first_delay_s=5.0, longest_delay_s=5.0)
        station.until(lambda: any(is_up for is_up, _ in station.states) or len(station.states) > 1)
        idle_until = time.monotonic() + 0.2
        while (left := idle_until - time.monotonic()) > 0:
            station.read(left)
        assert all(why.startswith(f"mqtt://127.0.0.1:{listener.port}: ") for _, why in station.states)


@hypothesis_settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(octets=st.binary(max_size=200))
def test_random_octets_end_the_connection_and_not_the_process(octets):
    with Listener(answering(CONNACK, SUBACK + octets)) as listener:
        station = Station(settings(f"mqtt://127.0.0.1:{listener.port}", profile="raw", first_delay_s=9.0))
        station.until(lambda: len(station.states) > 1)
        station.move(1, 2)  # it still listens
        station.close()


def with_topic(topic: bytes) -> bytes:
    """A PUBLISH of QoS 0 whose topic is no text."""
    made = publication("x" * len(topic), CAM)
    return made.replace(b"x" * len(topic), topic) if topic else made


def test_topics_of_strange_octets_are_counted(start):
    strange = [b"", b"\xff\xfe", b"v2x/\x00", b"v2x/\xed\xa0\x80", b"+/#", b"v2x/" + b"y" * 60_000, b"\xef\xbb\xbf"]
    with Mute() as broker:
        station = start(broker.port, profile="raw").up()
        for topic in strange:
            broker.throw(with_topic(topic))
        broker.throw(publication("v2x/denm", DENM))
        station.until(lambda: len(station.received) + sum(station.drops.values()) == 8)
        assert station.drops[Reason.TOPIC] >= 5
        assert station.received[-1].pdu == DENM


def test_a_packet_that_never_ends_is_not_kept_and_the_keep_alive_ends_it(start):
    with Mute(frozenset({mute.PINGRESP})) as broker:
        station = start(broker.port, profile="raw", keep_alive_s=1).up()
        broker.throw(b"\x30\xff\xff\xff\x7f\x00\x07v2x/cam\x00" + bytes(1_000_000))
        station.until(lambda: Reason.PAYLOAD in station.drops)
        assert station.samples[Reason.PAYLOAD] == b"v2x/cam"
        station.down("does not answer to PINGREQ")


def test_ten_megabytes_are_skipped_and_acknowledged(start):
    with Mute() as broker:
        station = start(broker.port, profile="raw").up()
        broker.throw(publication("v2x/cam", bytes(10_000_000), number=77) + publication("v2x/denm", DENM))
        station.until(lambda: station.received and station.drops)
        assert station.drops == {Reason.PAYLOAD: 1}
        assert broker.next(mute.PUBACK).body[:2] == (77).to_bytes(2)


def test_quality_of_service_2_which_nobody_asked_for_ends_the_connection(start):
    with Mute() as broker:
        station = start(broker.port, profile="raw").up()
        broker.throw(bytes((0x34, 12)) + b"\x00\x07v2x/cam\x00\x01\x00")
        station.down("quality of service")


# The station's side.


@pytest.mark.parametrize("is_up", [True, False])
def test_it_ends_at_once_when_the_station_leaves(start, is_up):
    with Mute() if is_up else FullBacklog() as broker:
        station = start(broker.port)
        if is_up:
            station.up()
        before = time.monotonic()
        station.close()
        assert time.monotonic() - before < 0.5


def test_a_profile_that_is_not_there_is_a_fault(turns):
    station = Station(settings("mqtt://127.0.0.1:1", profile="absent/vcaptian.toml"))
    station.until(lambda: station.faults)
    assert "vcaptian" in station.faults[0][0]
    station.close()
