"""Contract, section 3: RawRxMessage, read by a decoder without the station's code."""

import time

import pytest

from tests.system.air import NEIGHBOUR, single_hop
from tests.system.conftest import Bench, Launcher
from tests.system.rawrx import OVERHEAD, decode

PDU = bytes.fromhex("02020000053900010203")
PLACE = {"latitude": 48.7668616, "longitude": 11.432068}

# "All of rxInfo zero", then one with every kind of value (section 3).
GOLDEN = [
    "6000000020000000200000000000000000000000000000000000000000000000000000000000000000000000000000000000200000002000000000000000000000000000000000140240808000014e40004080c0",
    "7ac013d6a001c2cb5fee40030080400000000000000000000000000000000000000000000000000000000000000000000000270323aa224dc09000000000000000102030405060140240808000014e40004080c0",
]


@pytest.fixture(scope="module")
def shared_plain(launch_shared: Launcher) -> Bench:
    return launch_shared("ethernet", endpoint={"local_info": False})


@pytest.fixture
def plain(shared_plain: Bench) -> Bench:
    """Return a shared station with framing ethernet and without localInfo."""
    return shared_plain.settled()


@pytest.mark.parametrize("length", [6, 7, 10, 41, 300, 1499, 1500])
def test_without_local_info_the_overhead_is_74_octets(plain: Bench, length: int) -> None:
    plain.air.send(PDU[:6] + bytes(length - 6))
    assert len(plain.user.receive().raw) == OVERHEAD + length


def test_the_fields_of_a_single_hop_broadcast(plain: Bench) -> None:
    before = time.time()
    plain.air.throw(single_hop(PDU))
    fields = plain.user.receive().fields
    after = time.time()
    assert before - 0.001 <= fields["sec"] + fields["usec"] / 1e6 <= after
    assert fields | {"sec": 0, "usec": 0} == {
        "local": None,
        "sec": 0,
        "usec": 0,
        "rssi": 0,
        "data_rate": 0,
        "traffic_class": 2,
        "hop_limit": 1,
        "security_status": 0,
        "its_aid": 0,
        "ssp_len": 0,
        "ssp": bytes(32),
        "latitude": 487668616,
        "longitude": 114320679,
        "area_type": 0,
        "distance_a": 0,
        "distance_b": 0,
        "angle": 0,
        "mac": NEIGHBOUR,
        "payload_size": len(PDU),
        "pdu": PDU,
    }


def test_what_a_bare_pdu_cannot_tell_is_zero(launch: Launcher) -> None:
    bench = launch("pdu", endpoint={"local_info": False})
    bench.air.send(PDU)
    raw = bench.user.receive().raw
    fields = decode(raw)
    assert fields["sec"] > 1_700_000_000
    # With the time set to zero, the message equals the first golden vector.
    value = int.from_bytes(raw, "big")
    time_bits = ((1 << 64) - 1) << (8 * len(raw) - 66)
    zero_time = (1 << 63 | 1 << 31) << (8 * len(raw) - 66)
    assert (value & ~time_bits | zero_time).to_bytes(len(raw), "big").hex() == GOLDEN[0]


def test_local_info_has_own_time_and_place_where_they_are_known(launch: Launcher) -> None:
    bench = launch("ethernet", station={"position": PLACE})
    bench.air.send(PDU)
    fields = bench.user.receive().fields
    local = fields["local"]
    assert (local["latitude"], local["longitude"]) == (487668616, 114320680)
    assert local["sec"] > 1_700_000_000
    assert fields["pdu"] == PDU


def test_the_legacy_profile_fills_no_local_info(launch: Launcher) -> None:
    bench = launch("pdu", station={"profile": "legacy", "position": PLACE})
    bench.air.send(PDU)
    assert bench.user.receive().fields["local"] is None


def test_microseconds_stay_below_a_million(plain: Bench) -> None:
    for _ in range(100):
        plain.air.send(PDU)
    received = [plain.user.receive().fields for _ in range(100)]
    stamps = [(fields["sec"], fields["usec"]) for fields in received]
    assert all(0 <= usec < 1_000_000 for _, usec in stamps)
    assert stamps == sorted(stamps)
