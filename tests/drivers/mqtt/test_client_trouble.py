"""MQTT process at brokers that close or stay silent: bounded, reported, no busy loop."""

import contextlib
import socket
import threading
import time

import pytest

from drivers.mqtt.client.connector import SEND_BUFFER
from drivers.reason import Reason
from tests.broker import mute
from tests.broker.bad import FullBacklog, Listener, closing_after, silent
from tests.broker.mute import Mute, publication
from tests.drivers.mqtt.station import CAM, Station, settings
from tests.drivers.mqtt.watched import CONNACK, SUBACK, idles, start, turns

__all__ = ["start", "turns"]


# Brokers that close.


@pytest.mark.parametrize("after_s", [0.0, 0.05])
def test_one_that_closes_each_connection_is_asked_ever_less(start, after_s):
    with Listener(closing_after(after_s)) as listener:
        station = start(listener.port, first_delay_s=0.05, longest_delay_s=30.0)
        station.down("before CONNACK; if the broker needs TLS, write mqtts:// in url")
        end = time.monotonic() + 1.0
        while (left := end - time.monotonic()) > 0:
            station.read(left)
        assert 2 <= listener.accepted <= 7
        assert len(station.states) == 2  # the same state is reported only once


def test_broker_that_closes_after_its_connack_is_reported_with_client_id(start):
    def moment(line: socket.socket, _over) -> None:
        line.recv(1000)
        line.sendall(CONNACK)
        line.recv(1000)

    with Listener(moment) as listener:
        start(listener.port).down("soon after CONNACK", "client_id")


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
    """Broker that accepts connection and subscriptions, and then stops reading until the test resumes it."""

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
        listener._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, DEAF_BUFFER)  # accepted connections inherit it
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
        listener._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, DEAF_BUFFER)  # accepted connections inherit it
        station = start(listener.port, profile="raw", qos=0, max_in_flight=500, stall_s=60.0).up()
        for number in range(500):
            station.send(number, CAM + bytes(50), lifetime=0.3)
        station.until(lambda: len(station.sent) == 500)
        deaf.read_on()
        written = sum(reason is None for reason, _ in station.sent.values())
        assert deaf.read.count(CAM) == written


def test_one_that_reads_no_acknowledgements_is_not_read_from_without_end(start, turns):
    """The broker sends messages that need acknowledgements, and reads nothing: the queue of these stays bounded."""

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
