"""Frames of an independent station (Vanetza's socktap) through the endpoint: tests/captures/frames.json."""

import pytest

from tests.system.air import HEADERS
from tests.system.conftest import Bench, Launcher

# Names in frames.json. In that run, station 1 had the address that ends in 0b, station 2 the one in 0a. The position is
# the one with which socktap was started.
UNSECURED = ["cam-shb", "cam-shb-2", "udp-payload"]
SIGNED = ["cam-signed-certificate", "cam-signed-digest"]


@pytest.fixture(scope="module")
def shared_strict(launch_shared: Launcher) -> Bench:
    return launch_shared("ethernet", reception={"unverified": "drop", "gn_versions": [0, 1]})


@pytest.fixture
def strict(shared_strict: Bench) -> Bench:
    """Return a shared station that drops signed packets and accepts protocol version 0."""
    return shared_strict.settled()


@pytest.mark.parametrize("name", UNSECURED)
def test_its_cams_arrive_unchanged_with_what_their_headers_say(
    ethernet: Bench, frames: dict[str, bytes], name: str
) -> None:
    frame = frames[name]
    ethernet.air.throw(frame)
    received = ethernet.user.receive()
    assert (received.envelope, received.pdu) == (b"v2x.cam.", frame[HEADERS:])
    fields = received.fields
    assert fields["mac"] == frame[6:12]
    assert (fields["latitude"], fields["longitude"]) == (487668616, 114320679)
    assert (fields["hop_limit"], fields["traffic_class"]) == (1, 0)
    assert (fields["security_status"], fields["its_aid"], fields["ssp_len"]) == (0, 0, 0)
    assert (fields["area_type"], fields["distance_a"], fields["distance_b"], fields["angle"]) == (0, 0, 0, 0)


def test_a_packet_that_is_no_its_message_is_dropped_with_its_reason(ethernet: Bench, frames: dict[str, bytes]) -> None:
    before = ethernet.station.drops().get(("g5", "btp-port"), 0)
    ethernet.air.throw(frames["hello-shb"])
    ethernet.user.hears_nothing_before_a_mark(ethernet.air)
    assert ethernet.station.drops()["g5", "btp-port"] == before + 1


@pytest.mark.parametrize("name", SIGNED)
def test_signed_packets_are_dropped_with_their_reason_where_that_is_wanted(
    strict: Bench, frames: dict[str, bytes], name: str
) -> None:
    before = strict.station.drops().get(("g5", "secured"), 0)
    strict.air.throw(frames[name])
    strict.user.hears_nothing_before_a_mark(strict.air)
    assert strict.station.drops()["g5", "secured"] == before + 1


@pytest.mark.parametrize("name", SIGNED)
def test_signed_packets_are_delivered_as_unverifiable_by_default(
    ethernet: Bench, frames: dict[str, bytes], name: str
) -> None:
    ethernet.air.throw(frames[name])
    received = ethernet.user.receive()
    assert received.envelope == b"v2x.cam."
    assert received.pdu in frames[name]
    assert (len(received.pdu), received.pdu[:2]) == (41, b"\2\2")
    fields = received.fields
    assert fields["security_status"] == 3  # unverifiable-pkt
    assert fields["its_aid"] == 36  # CA basic service (TS 102 965)
    assert fields["mac"] == frames[name][6:12]
    assert (fields["latitude"], fields["longitude"]) == (487668616, 114320679)


def test_unverified_delivery_is_reported_once_in_the_log_and_counted_in_the_status(
    launch: Launcher, frames: dict[str, bytes]
) -> None:
    bench = launch("ethernet")
    assert bench.station.status()["security"] == {"verifies": False, "unverified": "deliver", "delivered": 0}
    for name in SIGNED:
        bench.air.throw(frames[name])
        assert bench.user.receive().fields["security_status"] == 3
    assert bench.station.status()["security"]["delivered"] == len(SIGNED)
    assert bench.station.stderr.read_text().count("signatures are not verified yet") == 1


@pytest.mark.parametrize("name", SIGNED)
def test_a_signed_packet_that_is_spoilt_is_dropped(ethernet: Bench, frames: dict[str, bytes], name: str) -> None:
    before = sum(ethernet.station.drops().values())
    envelope = 14 + 4
    ethernet.air.throw(frames[name][:envelope] + b"\x03\x82" + frames[name][envelope + 2 :])
    ethernet.air.throw(frames[name][:100])
    ethernet.user.hears_nothing_before_a_mark(ethernet.air)
    assert sum(ethernet.station.drops().values()) == before + 2


def test_protocol_version_0_is_dropped_with_its_reason_by_default(ethernet: Bench, frames: dict[str, bytes]) -> None:
    before = ethernet.station.drops().get(("g5", "gn-version"), 0)
    ethernet.air.throw(frames["cam-shb-gnversion0"])
    ethernet.user.hears_nothing_before_a_mark(ethernet.air)
    assert ethernet.station.drops()["g5", "gn-version"] == before + 1


def test_protocol_version_0_is_delivered_where_it_is_accepted(strict: Bench, frames: dict[str, bytes]) -> None:
    frame = frames["cam-shb-gnversion0"]
    strict.air.throw(frame)
    assert strict.user.receive().pdu == frame[HEADERS:]


def test_what_leaves_is_laid_out_as_the_independent_station_does_it(ethernet: Bench, frames: dict[str, bytes]) -> None:
    theirs = frames["cam-shb"]
    ethernet.user.send(b"v2x.", theirs[HEADERS:])
    while (ours := ethernet.air.socket.recv(2048))[19] != 0x50:
        pass
    assert len(ours) == len(theirs) == 99
    assert ours[:6] == b"\xff" * 6
    assert ours[6:12] == ours[28:34] == bytes.fromhex("0200000000aa")  # source, and the end of the GN address
    assert ours[12:14] == theirs[12:14]  # EtherType
    assert ours[14] == theirs[14]  # version 1, common header next
    assert ours[17] == theirs[17] == 1  # one hop
    assert ours[18:20] == theirs[18:20]  # BTP-B, single hop broadcast
    assert ours[22:24] == theirs[22:24]  # payload length
    assert ours[24] == 1  # maximum hop limit
    assert ours[54:] == theirs[54:]  # BTP and PDU


def test_a_beacon_of_a_neighbour_is_no_message_but_makes_it_known(launch: Launcher) -> None:
    bench = launch("ethernet")
    frame = bytearray.fromhex(
        "ffffffffffff02000000000d8947"  # Ethernet
        "11001a01"  # basic header
        "0010000000000100"  # common header: nothing next, beacon, no payload
        "800002000000000d2d2b45431d113b8806d0652780000000"  # long position vector
    )
    before = bench.station.status()["interfaces"]["g5"]["neighbours"]
    bench.air.throw(bytes(frame))
    bench.user.hears_nothing_before_a_mark(bench.air)
    assert bench.station.status()["interfaces"]["g5"]["neighbours"] == before + 1
    assert bench.station.drops() == {}
