"""MQTT process with a peer that is not a broker, or sends invalid MQTT."""

import time

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from drivers.reason import Reason
from tests.broker import mute
from tests.broker.bad import Listener, saying
from tests.broker.mute import Mute, publication
from tests.drivers.mqtt.station import CAM, DENM, Station, settings
from tests.drivers.mqtt.watched import CONNACK, SUBACK, answering, start, turns

__all__ = ["start", "turns"]


@pytest.mark.parametrize(
    ("octets", "words"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "does not answer by MQTT: b'HTTP/1.1'; correct host and port in url"),
        (b"\x15\x03\x03\x00\x02\x02\x28", "speaks TLS at this port; write mqtts:// in url"),
        (b"\x20\xff\xff\xff\xff\xff", "length has more than 4 octets"),
        (b"\x20\x00", "invalid MQTT"),
        (b"\x20\x03\x00\x00\xff", "invalid MQTT"),
        (b"\x34\x00", "does not answer by MQTT"),
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
    """Return a PUBLISH of QoS 0 with these octets as topic, which may be invalid UTF-8."""
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
        station.down("at QoS 2")
