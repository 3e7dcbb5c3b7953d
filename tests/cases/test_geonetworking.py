"""GeoNetworking of other stacks: a request for our position, protocol versions, lifetimes, short PDUs of any port."""

import socket
import struct
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from board.runtime.describe import read
from board.runtime.errors import ConfigurationError
from drivers.contract import NOW
from drivers.ethernet import EthernetOptions
from drivers.message import Area, Position, Shape
from drivers.packet.geolink import GeoLink
from drivers.reason import Reason
from drivers.udp.driver import Udp, UdpOptions
from drivers.wire import frame
from drivers.wire.geonet.header import HeaderType, ShortPosition
from drivers.wire.geonet.packet import LocationRequest, Unicast, parse
from drivers.wire.geonet.sender import ANSWERS_PER_S
from firmware.routing.drops import Drops
from firmware.routing.duplicates import Duplicates
from firmware.topics import Topics
from tests.drivers.host import EGO, SHARED, Host, request
from tests.drivers.wire.captured import tshark
from tests.firmware.doubles import NotingStation, ScriptedDriver, interface_of, pdu_of
from tests.virtual import VirtualLoop

CASES = Path(__file__).parent
OWN = bytes.fromhex("02000000000d")  # of the station that the captured requests are for
FLEXSTACK = bytes.fromhex("0200000000f5")
HELLO = bytes.fromhex("c0ffee")

# Seconds by type. CAM: EN 302 637-2 V1.4.1 clause 5.3.4.1; the others: firmware/topics.py.
LIFETIMES = {
    "cam": 1, "cpm": 1, "vam": 1, "mcm": 1, "spatem": 1, "srem": 1, "ssem": 1, "rtcmem": 1,
    "denm": 10, "mapem": 5, "ivim": 5, "poi": 5, "ev_rsr": 5, "tistpgtransaction": 5, "evcsn": 5, "saem": 5, "imzm": 5,
}  # fmt: skip


def frames_of(name: str) -> list[bytes]:
    """The frames of a classic capture file."""
    octets = (CASES / name).read_bytes()
    assert struct.unpack_from("<IHHiIII", octets)[-1] == 1  # link type Ethernet
    frames, at = [], 24
    while at < len(octets):
        size = struct.unpack_from("<8xI", octets, at)[0]
        frames.append(octets[at + 16 : at + 16 + size])
        at += 16 + size
    return frames


class Station:
    """A link of the station that the captures ask for, and what it sends without a request."""

    def __init__(self, loop: VirtualLoop, gn_version: int = 1) -> None:
        self.host = Host(loop)
        self.sent: list[bytes] = []
        self.link = GeoLink(self.host, SHARED, OWN, 0.0, self._transmit, gn_version)

    def _transmit(self, octets: bytes) -> object:
        self.sent.append(octets)
        return NOW

    def receive(self, octets: bytes) -> None:
        self.link.receive(octets, 0)


@pytest.fixture
def loop() -> Iterator[VirtualLoop]:
    with closing(VirtualLoop()) as loop:
        yield loop


@pytest.fixture
def station(loop: VirtualLoop) -> Station:
    return Station(loop)


REQUESTS = [one for one in frames_of("flexstack_ls_request_unanswered.pcap") if one[6:12] == FLEXSTACK]


def asking(sequence: int) -> bytes:
    """The captured request with another sequence number."""
    return REQUESTS[0][:26] + sequence.to_bytes(2) + REQUESTS[0][28:]


# --- Location Service ---


def test_each_request_for_the_own_position_is_answered_with_it(loop: VirtualLoop, station: Station) -> None:
    for octets in REQUESTS:
        station.receive(octets)
        loop.run_for(1.0)
    assert len(station.sent) == len(REQUESTS) == 8
    assert station.host.drops == {}
    assert station.host.neighbours == [FLEXSTACK] * 8
    for number, (asked, answer) in enumerate(zip(REQUESTS, station.sent, strict=True)):
        assert answer[:12] == FLEXSTACK + OWN
        sent, question = parse(answer[14:]), parse(asked[14:]).extended
        assert isinstance(question, LocationRequest)
        assert sent.common.header_type == HeaderType.LS_REPLY
        body = sent.extended
        assert isinstance(body, Unicast)
        assert (body.sequence, body.source.address.mac) == (number, OWN)
        assert (body.source.latitude, body.source.longitude) == EGO.position
        assert body.destination == ShortPosition(*question.source[:4])


def test_tshark_shows_the_reply_with_the_position_of_the_station_that_asked(station: Station, tmp_path: Path) -> None:
    station.receive(REQUESTS[0])
    (fields,) = tshark(station.sent, tmp_path)
    assert int(fields["geonw.ch.htype"], 0) == HeaderType.LS_REPLY
    assert (fields["geonw.bh.version"], fields["geonw.bh.rhl"], fields["geonw.ch.mhl"]) == ("1", "10", "10")
    assert fields["geonw.ch.plength"] == "0"
    assert not {"geonw.reserved_not_zero", "_ws.malformed", "geonw.position_oor"} & set(fields)


def test_a_request_for_the_position_of_another_station_is_not_answered(loop: VirtualLoop, station: Station) -> None:
    for octets in REQUESTS:
        station.receive(octets[:-1] + b"\x0e")
    assert (station.sent, station.host.drops) == ([], {Reason.GN_NOT_FOR_US: 8})


def test_a_flood_of_requests_is_answered_ten_times_a_second_and_the_rest_is_counted(
    loop: VirtualLoop, station: Station
) -> None:
    for number in range(1000):
        station.receive(asking(number))
    assert (len(station.sent), station.host.drops) == (ANSWERS_PER_S, {Reason.GN_REQUESTS: 990})
    loop.run_for(1.0)
    for number in range(1000, 2000):
        station.receive(asking(number))
    assert (len(station.sent), station.host.drops) == (2 * ANSWERS_PER_S, {Reason.GN_REQUESTS: 1980})


def test_an_answer_begins_the_silence_before_the_next_beacon_anew(loop: VirtualLoop) -> None:
    station = Station(loop)
    station.link = GeoLink(station.host, SHARED, OWN, 3.0, station._transmit)
    station.link.start()
    for number in range(20):
        station.receive(asking(number))
        loop.run_for(1.0)
    assert [octets[19] for octets in station.sent] == [HeaderType.LS_REPLY] * 20


# --- protocol version ---


@pytest.mark.parametrize("version", [0, 1])
def test_what_is_sent_has_the_version_of_the_interface(loop: VirtualLoop, tmp_path: Path, version: int) -> None:
    station = Station(loop, version)
    area = Area(Shape.CIRCLE, Position(487_668_616, 114_320_680), 500)
    station.receive(REQUESTS[0])
    frames = [*station.sent, *(station.link.encode(request(pdu_of(2), area=one)) for one in (None, area))]
    shown = tshark(frames, tmp_path)
    assert [int(fields["geonw.ch.htype"], 0) for fields in shown] == [0x61, 0x50, 0x40]
    assert {fields["geonw.bh.version"] for fields in shown} == {str(version)}


@pytest.mark.parametrize("version", [0, 1])
def test_a_beacon_has_the_version_of_the_interface(loop: VirtualLoop, version: int) -> None:
    station = Station(loop)
    station.link = GeoLink(station.host, SHARED, OWN, 1.0, station._transmit, version)
    station.link.start()
    loop.run_for(3.0)
    assert {octets[14] >> 4 for octets in station.sent} == {version}


def test_a_station_that_sends_version_0_hears_it_beside_version_1(loop: VirtualLoop) -> None:
    old, new = Station(loop, 0), Station(loop)
    for version in (0, 1):
        octets = bytearray(asking(version))
        octets[14] = version << 4 | 1
        old.receive(bytes(octets))
        new.receive(bytes(octets))
    assert (len(old.sent), old.host.drops) == (2, {})
    assert (len(new.sent), new.host.drops) == (1, {Reason.GN_VERSION: 1})


@pytest.mark.parametrize(("options", "version"), [({}, 1), ({"gn_version": 0}, 0), ({"gn_version": 1}, 1)])
def test_a_datagram_has_the_version_that_the_option_names(
    loop: VirtualLoop, options: dict[str, int], version: int
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(2)
        made = read(
            UdpOptions, {"peers": ["{}:{}".format(*peer.getsockname())], "beacon_s": 0.0, **options}, "captain.toml"
        )
        driver = Udp(made, SHARED)
        driver.start(Host(loop))
        driver.send(request(pdu_of(2)))
        driver.stop()
        assert peer.recv(2048)[14] >> 4 == version


@pytest.mark.parametrize("table", [(UdpOptions, {"listen": "127.0.0.1:0"}), (EthernetOptions, {"device": "wlan0"})])
def test_a_version_other_than_0_and_1_is_refused(table: tuple[type, dict[str, object]]) -> None:
    options, given = table
    assert read(options, given, "captain.toml").gn_version == 1
    with pytest.raises(ConfigurationError, match="gn_version"):
        read(options, {**given, "gn_version": 2}, "captain.toml")


# --- lifetime ---


def test_tshark_shows_the_lifetime_of_each_type_in_its_single_hop_broadcast(
    loop: VirtualLoop, station: Station, tmp_path: Path
) -> None:
    kinds = [kind for kind in Topics().kinds if kind.name]
    asked = [request(pdu_of(kind.number))._replace(kind=kind, btp_port=42) for kind in kinds]
    shown = tshark([station.link.encode(one) for one in asked], tmp_path)
    units = {"0": 0.05, "1": 1, "2": 10, "3": 100}
    seconds = {
        kind.name: int(fields["geonw.bh.lt.mult"]) * units[fields["geonw.bh.lt.base"]]
        for kind, fields in zip(kinds, shown, strict=True)
    }
    assert seconds == LIFETIMES


# --- short PDUs of any port ---


HELLOS = [one for one in frames_of("vanetza_hello_port42.pcap") if one.endswith(HELLO)]


class Receiving:
    """An interface with GeoNetworking."""

    def __init__(self, loop: VirtualLoop, takes_any_port: bool) -> None:
        self.above, self.drops = NotingStation(), Drops()
        self.interface = interface_of(loop, self.above, ScriptedDriver(), drops=self.drops)
        if takes_any_port:
            self.interface.accept_any_port()
        self.link = GeoLink(self.interface, SHARED, OWN, 0.0, lambda octets: NOW)


def test_a_short_pdu_of_an_unknown_port_is_dropped_for_its_port(loop: VirtualLoop) -> None:
    receiving = Receiving(loop, takes_any_port=False)
    for octets in HELLOS:
        receiving.link.receive(octets, 0)
    assert len(HELLOS) == 6
    assert receiving.above.indications == []
    assert receiving.drops.total("g5", Reason.BTP_PORT) == 6
    assert receiving.drops.sum("g5", frozenset({Reason.DUPLICATE})) == 6


def test_a_short_pdu_of_an_unknown_port_is_delivered_where_that_is_wanted(loop: VirtualLoop) -> None:
    receiving = Receiving(loop, takes_any_port=True)
    for octets in HELLOS:
        receiving.link.receive(octets, 0)
    found = receiving.above.indications
    assert [(one.pdu, one.rx.btp_port, one.kind.name) for one in found] == [(HELLO, 42, "")] * 6
    assert receiving.drops.sum("g5", frozenset({Reason.DUPLICATE})) == 0


def test_a_short_pdu_of_a_known_port_stays_short(loop: VirtualLoop) -> None:
    receiving = Receiving(loop, takes_any_port=True)
    (octets, *_) = HELLOS
    receiving.link.receive(octets[:54] + (2001).to_bytes(2) + octets[56:], 0)
    assert receiving.drops.total("g5", Reason.SHORT_PDU) == 1


@pytest.mark.parametrize("size", range(1, 6))
def test_the_paths_of_short_pdus_have_no_station(loop: VirtualLoop, size: int) -> None:
    receiving = Receiving(loop, takes_any_port=True)
    pdu = HELLO.ljust(5, b"\0")[:size]
    receiving.link.receive(HELLOS[0][:22] + (size + 4).to_bytes(2) + HELLOS[0][24:58] + pdu, 0)
    duplicates = Duplicates(1.0, receiving.drops, Topics())
    assert duplicates(receiving.above.indications) == receiving.above.indications
    duplicates.expire(loop.now + 3.0)
    (path,) = duplicates.status()["paths"]
    assert (path["station"], path["type"], path["alone"]) == (None, "", {"g5": 1})


def test_the_frame_around_an_answer_goes_to_the_station_that_sent_the_request() -> None:
    assert frame.wrap(OWN, b"packet", FLEXSTACK) == FLEXSTACK + OWN + b"\x89\x47packet"
