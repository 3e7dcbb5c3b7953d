"""MQTT process at brokers that refuse connections, wills, subscriptions or messages."""

import socket
import threading
import time

import pytest

from drivers.reason import Reason
from tests.broker import mute
from tests.broker.bad import Listener
from tests.broker.mute import Mute
from tests.drivers.mqtt.station import CAM, written
from tests.drivers.mqtt.watched import SUBACK, answering, start, turns
from tests.said import tells

__all__ = ["start", "turns"]


WILL = """
name = "will"
publish = []
subscribe = []
status = { topic = "s", lost = "gone", retain = true }
"""


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


def test_message_that_the_broker_refuses_fails_with_its_reason(start):
    with Mute(puback=0x97) as broker:
        station = start(broker.port, profile="raw").up()
        station.send(1)
        station.until(lambda: station.sent)
        reason, why = station.sent[1]
        assert reason is Reason.SEND_FAILED
        assert tells(why, f"mqtt://127.0.0.1:{broker.port}: ", "Quota exceeded")
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
