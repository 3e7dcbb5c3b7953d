"""Raw sockets: frames with all that they say, their sender, and options."""

import pytest

from board.netlink import device
from board.runtime.describe import read
from board.runtime.errors import ConfigurationError, RequestError
from drivers.contract import Sent
from drivers.ethernet import EthernetOptions
from drivers.message import Area, Position, Shape
from drivers.wire.geonet.header import Address
from drivers.wire.geonet.packet import parse
from tests.drivers.host import CAM, DENM, EGO, MAC, SHARED, Host, request, told
from tests.drivers.veth import CAM_FRAME, PDU, air, ip, started, veth

pytestmark = pytest.mark.namespace


def test_a_frame_of_another_station_arrives_with_all_that_it_says(loop, host):
    veth()
    started(host)
    air().send(CAM_FRAME)
    told(loop, lambda: host.indications)
    ((pdu, received_ns, rx),) = host.indications
    assert pdu == PDU
    assert received_ns > 1_600_000_000 * 10**9
    assert (rx.btp_port, rx.transport, rx.source_mac) == (2001, "shb", CAM_FRAME[6:12])
    assert rx.position == Position(487668616, 114320679)


def test_a_request_leaves_as_a_broadcast_of_the_devices_own_address(host):
    veth()
    driver = started(host)
    other = air()
    assert driver.send(request(CAM)) is Sent.NOW
    frame = other.recv(2048)
    assert frame[:14] == b"\xff" * 6 + device("v2x0").mac + bytes.fromhex("8947")
    assert frame.endswith(bytes.fromhex("07d10000") + CAM)


def test_a_request_with_an_area_is_a_geobroadcast_and_arrives_as_one(loop, host):
    veth()
    other = Host(loop)
    driver = started(host)
    started(other, device="air0")
    area = Area(Shape.CIRCLE, EGO.position, 500)
    driver.send(request(DENM, area=area))
    told(loop, lambda: other.indications)
    ((pdu, _, rx),) = other.indications
    assert (pdu, rx.btp_port, rx.transport, rx.area) == (DENM, 2002, "gbc", area)


def test_a_configured_address_is_the_sender(host):
    veth()
    driver = started(host, mac="02:00:00:00:00:0c")
    other = air()
    driver.send(request(CAM))
    assert other.recv(2048)[6:12] == MAC


def sent_with(host, shared, **options):
    """Return the position vector in the first packet that a station with these options sends."""
    driver = started(host, shared, **options)
    other = air()
    driver.send(request(CAM))
    packet = parse(other.recv(2048)[14:])
    driver.stop()
    return packet


def test_the_station_says_what_it_is(host):
    veth()
    shared = SHARED._replace(station_type=15, is_mobile=False)
    packet = sent_with(host, shared)
    assert packet.extended.source.address == Address(False, 15, 0, device("v2x0").mac)
    assert packet.common.flags == 0


@pytest.mark.parametrize("is_configured", [True, False])
def test_an_address_of_the_interfaces_own_options_is_a_configured_one_and_the_devices_is_not(host, is_configured):
    veth()
    shared = SHARED._replace(is_mac_configured=is_configured)
    assert sent_with(host, shared, mac="02:00:00:00:00:0c").extended.source.address.is_manual
    assert not sent_with(host, shared).extended.source.address.is_manual


def test_beacons_are_sent_and_heard(loop, host):
    veth()
    other = Host(loop)
    started(host, beacon_s=3.0)
    started(other, device="air0", mac="02:00:00:00:00:0d")
    loop.run_until(lambda: other.neighbours, within=10)
    assert other.neighbours[0] != bytes(6)
    assert other.drops == {}


def test_a_frame_longer_than_the_device_takes_is_the_users_fault(host):
    veth()
    ip("link set v2x0 mtu 200")
    driver = started(host)
    with pytest.raises(RequestError, match="too long for v2x0"):
        driver.send(request(CAM + bytes(300)))
    assert driver.send(request(CAM)) is Sent.NOW


@pytest.mark.parametrize("table", [
    {}, {"device": ""}, {"device": "a" * 16}, {"device": "wlan0", "mac": "02:00:00:00:00"},
    {"device": "wlan0", "mac": "03:00:00:00:00:01"}, {"device": "wlan0", "mac": "020000000001"},
    {"device": "wlan0", "mac": "02:00:00:00:00:zz"}, {"device": "wlan0", "beacon_s": -1.0},
])  # fmt: skip
def test_options_that_cannot_be_meant_are_refused(table):
    with pytest.raises(ConfigurationError, match=r"captain\.toml"):
        read(EthernetOptions, table, "captain.toml")


def test_each_option_that_cannot_be_meant_is_told_with_its_key():
    with pytest.raises(ConfigurationError) as refused:
        read(EthernetOptions, {"device": "a/b", "mac": "zz"}, "captain.toml")
    assert refused.value.message.split("\n") == [
        'captain.toml: device: invalid name of a network device: "a/b"; `ip -brief link` lists them',
        'captain.toml: mac: invalid MAC address of a station: "zz"; write for example 02:00:00:00:00:0b',
    ]
