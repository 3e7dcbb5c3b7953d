"""Pairing of a message's three parts, as the station builds them."""

import hashlib
import json

import captain_messages
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.message import Position, RxInfo, Security, SecurityStatus
from drivers.wire import raw
from firmware.gateway.captain_gateway.captain_gateway.errors import GatewayError
from firmware.gateway.captain_gateway.captain_gateway.pairing import (
    LATEST_S,
    MOST,
    How,
    Joining,
    RawReader,
    Waiting,
    indication,
    key,
)
from tests.firmware.gateway.real import CAM

READ = RawReader(captain_messages)
RX = RxInfo(
    rssi_dbm=-71, data_rate=12, traffic_class=2, hop_limit=3, security=Security(SecurityStatus.VERIFIED_PKT, 36),
    position=Position(470585000, 154600000), source_mac=bytes.fromhex("020304050607"),
)  # fmt: skip
RECEIVED_NS = 1_795_182_426_461_613_000
OWN = (RECEIVED_NS + 5_000_000, Position(470600000, 154700000))


class Small:
    __file__ = "captain_messages.abi3.so"

    @staticmethod
    def find(name: str) -> None:
        raise KeyError(name)


def test_a_library_without_the_message_of_a_reception_is_refused_with_what_to_do():
    with pytest.raises(GatewayError, match="lacks the message rawrx-1"):
        RawReader(Small)


def message(pdu: bytes = CAM) -> bytes:
    return raw.build(pdu, RECEIVED_NS, RX, OWN)


def test_everything_that_the_station_knows_of_a_reception_is_read():
    found, pdu = READ(message())
    assert pdu == CAM
    assert (found.received_ns, found.own_ns, found.own) == (RECEIVED_NS, OWN[0], OWN[1])
    assert (found.rssi_dbm, found.data_rate, found.traffic_class, found.hop_limit) == (-71, 12, 2, 3)
    assert (found.security_status, found.its_aid, found.source_mac) == (2, 36, RX.source_mac)
    assert found.sender == RX.position


def test_what_the_station_does_not_know_is_not_made_up():
    found, _ = READ(raw.build(CAM, RECEIVED_NS, RxInfo()))
    assert (found.own_ns, found.own, found.sender, found.rssi_dbm, found.security_status) == (0, None, None, 0, 0)


@given(
    rssi=st.integers(-32768, 32767), rate=st.integers(0, 65535), received_us=st.integers(0, (1 << 31) * 1_000_000 - 1),
    latitude=st.integers(-(1 << 31), (1 << 31) - 1), pdu=st.binary(min_size=1, max_size=200),
)  # fmt: skip
def test_a_message_reads_as_the_station_itself_reads_it(rssi, rate, received_us, latitude, pdu):
    rx = RxInfo(rssi_dbm=rssi, data_rate=rate, position=Position(latitude, 1))
    octets = raw.build(pdu, received_us * 1000, rx)
    found, same = READ(octets)
    theirs = raw.parse(octets)
    assert same == theirs.pdu == pdu
    assert (found.received_ns, found.data_rate, found.sender) == (theirs.received_ns, rate, theirs.rx.position)
    assert found.rssi_dbm == (theirs.rx.rssi_dbm or 0)


def test_both_parts_of_a_message_are_joined():
    joining = Joining(READ)
    assert joining.feed([b"raw.", message()]) is None
    arrival = joining.feed([b"v2x.cam.", CAM])
    assert arrival is not None
    assert (arrival.type, arrival.pdu) == ("cam", CAM)
    assert arrival.reception is not None
    assert arrival.reception.rssi_dbm == -71


def test_what_is_known_of_one_message_is_not_said_of_another():
    joining = Joining(READ)
    joining.feed([b"raw.", message(CAM[:40])])
    arrival = joining.feed([b"v2x.cam.", CAM])
    assert arrival is not None
    assert arrival.reception is None
    again = joining.feed([b"v2x.cam.", CAM[:40]])
    assert again is not None
    assert again.reception is None


@pytest.mark.parametrize(
    "frames",
    [[], [b"v2x.cam."], [b"v2x.cam.", b"", b""], [b"raw.", b""], [b"raw.", b"\xff"], [b"x", b"y"], [b"v2x.", b"y"]],
)
def test_rubbish_is_counted_and_does_no_harm(frames):
    joining = Joining(READ)
    assert joining.feed(frames) is None
    assert joining.rubbish == 1
    assert joining.feed([b"v2x.cam.", CAM]) is not None


def test_a_heartbeat_is_no_rubbish():
    joining = Joining(READ)
    joining.feed([b"hb.counter", b'{"heartbeat_counter": 7}'])
    assert joining.rubbish == 0


@given(frames=st.lists(st.binary(max_size=90), max_size=4))
def test_any_frames_are_taken(frames):
    Joining(READ).feed(frames)


def said(**changed: object) -> bytes:
    told = {
        "digest": hashlib.sha256(CAM).hexdigest()[:16], "interface": "g5", "received_ns": RECEIVED_NS + 999,
        "btp_port": 2001, "source": "02:03:04:05:06:07",
    }  # fmt: skip
    return json.dumps(told | changed).encode()


def test_an_indication_is_known_by_digest_and_microsecond():
    assert indication(said()) == (key(CAM, RECEIVED_NS), How("g5", 2001, "02:03:04:05:06:07"))
    assert indication(said(btp_port=None, source=None)) == (key(CAM, RECEIVED_NS), How("g5", 0, ""))


@pytest.mark.parametrize(
    "octets",
    [
        b"",
        b"[]",
        b"{}",
        b"{",
        b"7",
        b"\xff",
        said(digest="xy"),
        said(received_ns="late"),
        said(btp_port=[1]),
        said(btp_port=65536),
        said(btp_port=float("inf")),
        said(received_ns=float("nan")),
        said(btp_port=10**400),
        said(interface="\ud800"),
        said(interface="SURROGATE").replace(b"SURROGATE", b"\xed\xa0\x80"),
        said(interface="\ud800").decode().encode("utf-16-be"),
    ],
)
def test_an_indication_that_is_none_is_passed_by(octets):
    assert indication(octets) is None


def test_a_message_waits_for_its_indication_or_finds_it():
    waiting = Waiting()
    one, other = key(CAM, 1_000), key(CAM, 2_000)
    assert waiting.message(one, "first", 0.0) is None
    assert waiting.indication(one, How("g5", 2001, "")) == "first"
    assert waiting.indication(other, How("mqtt", 2001, "")) is None
    assert waiting.message(other, "second", 0.0) == How("mqtt", 2001, "")
    assert waiting.is_empty


def test_a_message_does_not_wait_for_ever():
    waiting = Waiting()
    waiting.message(key(CAM, 1_000), "first", 0.0)
    assert waiting.expired(LATEST_S - 0.001) == []
    assert waiting.expired(LATEST_S) == ["first"]
    assert waiting.is_empty


def test_indications_of_duplicates_that_never_come_are_forgotten():
    waiting = Waiting()
    for number in range(MOST + 1):
        waiting.indication(key(CAM, number * 1000), How("g5", 0, ""))
    assert waiting.message(key(CAM, 0), "first", 0.0) is None
    assert waiting.message(key(CAM, 1000), "second", 0.0) == How("g5", 0, "")


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400),
    lambda below: st.lists(below, max_size=3) | st.dictionaries(st.text(max_size=5), below, max_size=3),
    max_leaves=5,
)


@given(octets=st.binary(max_size=60))
def test_any_octets_are_an_indication_or_none(octets):
    indication(octets)


@given(told=st.fixed_dictionaries(dict.fromkeys(("digest", "interface", "received_ns", "btp_port", "source"), JSON)))
def test_any_values_are_an_indication_or_none(told):
    indication(json.dumps(told).encode())


def test_a_text_beyond_the_basic_plane_is_one():
    assert indication(said(interface="\U0001f697")) == (
        key(CAM, RECEIVED_NS),
        How("\U0001f697", 2001, "02:03:04:05:06:07"),
    )
