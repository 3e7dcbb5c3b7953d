"""Packets in an MQTT stream: complete ones, up to a size limit."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.wire.mqtt_packets import Oversized, Packets

LIMIT = 300
CONNACK = bytes.fromhex("2003000000")
PINGRESP = bytes.fromhex("d000")


def packet(first: int, body: bytes) -> bytes:
    """Return a packet, with the length encoded by MQTT 5.0, clause 1.5.5."""
    left, octets = len(body), bytearray()
    while True:
        left, part = left >> 7, left & 0x7F
        octets.append(part | (0x80 if left else 0))
        if not left:
            return bytes([first]) + bytes(octets) + body


def publish(payload: bytes, topic: bytes = b"t", number: int = 0) -> bytes:
    body = len(topic).to_bytes(2) + topic + (number.to_bytes(2) if number else b"") + payload
    return packet(0x32 if number else 0x30, body)


def cut(octets: bytes, places: list[int]) -> list[bytes]:
    edges = [0, *sorted(place % (len(octets) + 1) for place in places), len(octets)]
    return [octets[start:end] for start, end in pairwise(edges)]


def read(*parts: bytes) -> list[bytes | Oversized]:
    packets = Packets(LIMIT)
    return [one for part in parts for one in packets.receive(part)]


STREAM = [
    CONNACK,
    publish(b"", number=9),
    publish(bytes(127 - 3)),
    publish(bytes(128 - 3)),
    PINGRESP,
    publish(bytes(LIMIT - 3)),
]


@given(places=st.lists(st.integers(0, 2000), max_size=20))
def test_packets_are_whole_however_the_octets_arrive(places):
    assert read(*cut(b"".join(STREAM), places)) == STREAM


@given(places=st.lists(st.integers(0, 20_000), max_size=20))
def test_a_publish_that_is_too_long_is_skipped_and_what_follows_is_read(places):
    stream = [CONNACK, publish(bytes(LIMIT)), publish(b"a", number=3), publish(bytes(9000), b"topic", 77), PINGRESP]
    expected = [CONNACK, Oversized(0, b"t"), stream[2], Oversized(77, b"topic\0\x4d"), PINGRESP]
    assert read(*cut(b"".join(stream), places)) == expected


def test_of_what_is_skipped_nothing_is_kept():
    packets = Packets(LIMIT)
    list(packets.receive(CONNACK + b"\x30\xff\xff\xff\x7f\x00\x01t"))  # 268,435,455 octets
    for _ in range(100):
        assert list(packets.receive(bytes(65536))) == []
        assert len(packets._buffer) == 0


def test_a_topic_that_is_too_long_is_waited_for_and_no_more():
    packets = Packets(LIMIT)
    parts = [CONNACK, b"\x30\xff\xff\xff\x7f\xff\xff", *[bytes(8192)] * 9]
    assert [one for part in parts for one in packets.receive(part)] == [CONNACK, Oversized(0, bytes(65535))]
    assert len(packets._buffer) == 0


@pytest.mark.parametrize(
    ("octets", "words"),
    [
        (b"\x15\x03\x03\x00\x02\x02\x28", "speaks TLS"),
        (b"HTTP/1.1 400 Bad Request", "does not answer by MQTT: b'HTTP/1.1'"),
        (b"SSH-2.0-OpenSSH", "does not answer by MQTT: b'SSH-2.0-'"),
        (bytes(2), "by MQTT"),
        (CONNACK + b"\x20\xff\xff\xff\xff\x01", "length has more than 4 octets"),
        (CONNACK + b"\x34\x05\x00\x01t\x00\x01", "at QoS 2"),
        (CONNACK + b"\x36\x05\x00\x01t\x00\x01", "at QoS 2"),
        (CONNACK + b"\x90\xff\xff\xff\x7f", "268435455 octets that holds no message"),
    ],
)
def test_what_is_no_mqtt_is_named(octets, words):
    with pytest.raises(ProtocolError, match=words):
        read(octets)


@given(octets=st.binary(max_size=500), places=st.lists(st.integers(0, 500), max_size=5))
def test_random_octets_are_read_or_refused_and_kept_within_bounds(octets, places):
    packets = Packets(LIMIT)
    try:
        for part in cut(CONNACK + octets, places):
            for one in packets.receive(part):
                assert isinstance(one, Oversized) or len(one) <= LIMIT + 5
    except ProtocolError:
        return
    assert len(packets._buffer) <= LIMIT + 5 + 65537
