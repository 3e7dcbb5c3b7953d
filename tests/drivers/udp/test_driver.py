"""UDP driver with real sockets: only the station is a fake."""

import errno
import os
import socket

import pytest

from board.runtime.describe import read
from board.runtime.errors import ConfigurationError, InterfaceError, RequestError
from drivers.contract import Can, Sent
from drivers.message import NO_RX_INFO
from drivers.packet.intake import SO_RCVBUFFORCE, enlarge
from drivers.reason import Reason
from drivers.udp.driver import Udp, UdpOptions
from firmware.topics import Topics
from tests.drivers.bench import OtherStation
from tests.drivers.host import CAM, DENM, SHARED, Host, request, told
from tests.drivers.veth import ip, wait_for_carrier

LANED = SHARED._replace(lanes=Topics().lanes())


@pytest.fixture
def peer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(2)
        yield peer


@pytest.fixture
def start(host, at_end):

    def start(shared=SHARED, **options):
        options.setdefault("framing", "pdu")
        driver = Udp(UdpOptions(**options), shared)
        driver.start(host)
        at_end(driver.stop)
        return driver

    return start


def text(peer):
    return "{}:{}".format(*peer.getsockname())


def test_a_pdu_arrives_with_the_kernels_stamp(loop, host, start, peer):
    driver = start(listen="127.0.0.1:0")
    peer.sendto(CAM, driver.address)
    loop.run_until(lambda: host.indications)
    ((pdu, received_ns, rx),) = host.indications
    assert (pdu, rx) == (CAM, NO_RX_INFO)
    assert received_ns > 1_600_000_000 * 10**9


def test_a_pdu_leaves_unchanged_to_every_peer(start, peer):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second:
        second.bind(("127.0.0.1", 0))
        driver = start(peers=(text(peer), text(second)))
        assert driver.send(request(CAM)) is Sent.NOW
        assert [one.recv(2048) for one in (peer, second)] == [CAM, CAM]


def test_btp_puts_the_port_before_the_pdu_and_reads_it_back(loop, host, start, peer):
    driver = start(framing="btp", listen="127.0.0.1:0", peers=(text(peer),))
    driver.send(request(DENM))
    sent = peer.recv(2048)
    assert sent == bytes.fromhex("07d20000") + DENM
    peer.sendto(sent, driver.address)
    peer.sendto(bytes.fromhex("ffff0000") + CAM, driver.address)
    loop.run_until(lambda: host.count == 2)
    assert [(pdu, rx.btp_port) for pdu, _, rx in host.indications] == [(DENM, 2002), (CAM, 65535)]


@pytest.mark.parametrize("size", [0, 1, 2, 3])
def test_a_datagram_shorter_than_its_btp_header_is_truncated(loop, host, start, peer, size):
    driver = start(framing="btp", listen="127.0.0.1:0")
    peer.sendto(bytes(size), driver.address)
    loop.run_until(lambda: host.total)
    assert host.drops == {Reason.TRUNCATED: 1}


def test_denms_have_a_socket_of_their_own_and_are_read_first(loop, host, start, peer):
    driver = start(listen="127.0.0.1:0")
    for message in [CAM] * 20 + [DENM] * 3:
        peer.sendto(message, driver.address)
    loop.run_until(lambda: host.count == 23)
    # The CAMs became ready first, so one slice of them is read; then the DENMs overtake the others.
    assert host.pdus == [CAM] * 8 + [DENM] * 3 + [CAM] * 12


def test_a_flood_gives_way_after_a_batch(loop, host, start, peer):
    driver = start(listen="127.0.0.1:0")
    for _ in range(100):
        peer.sendto(CAM, driver.address)
    loop.turn()
    assert host.count == 32


def test_datagrams_of_no_or_few_octets_are_passed_up_and_end_no_batch(loop, host, start, peer):
    driver = start(listen="127.0.0.1:0")
    messages = [bytes(size) for size in range(6)] + [CAM]
    for message in messages:
        peer.sendto(message, driver.address)
    loop.turn()
    assert host.pdus == messages


def test_what_is_longer_than_any_frame_is_named_long(loop, host, start, peer):
    driver = start(listen="127.0.0.1:0")
    for message in (bytes(2048), bytes(2049), bytes(65507), CAM):
        peer.sendto(message, driver.address)
    loop.run_until(lambda: host.total == 4)
    assert host.pdus == [bytes(2048), CAM]
    assert host.drops == {Reason.LONG_PDU: 2}


@pytest.mark.parametrize("message", [CAM, DENM])
def test_what_the_kernel_dropped_is_counted_to_the_last_datagram(loop, host, start, peer, message):
    driver = start(listen="127.0.0.1:0", receive_buffer=4096)
    sent = 5000
    for _ in range(sent):
        peer.sendto(message, driver.address)
    driver.refresh()  # while nothing of it was read
    dropped = host.drops[Reason.KERNEL_QUEUE]
    loop.run_until(lambda: host.count == sent - dropped)
    driver.refresh()
    assert host.drops == {Reason.KERNEL_QUEUE: dropped}
    assert 0 < host.count < sent


def test_denms_pass_when_the_queue_of_the_rest_is_full(loop, host, start, peer):
    driver = start(listen="127.0.0.1:0", receive_buffer=4096)
    for message in [CAM] * 1000 + [DENM]:
        peer.sendto(message, driver.address)
    loop.run_until(lambda: DENM in host.pdus)


STATION = OtherStation()
OTHERS = (1, 4, 6, 16, 102, 77, 255)  # messageIDs: DENM, SPATEM, IVIM, VAM of both profiles, unknown ones
FRAMINGS = {"pdu": bytes, "btp": lambda pdu: bytes.fromhex("07d10000") + pdu, "ethernet": STATION.encode}


@pytest.mark.parametrize("framing", FRAMINGS)
def test_a_flood_of_cams_takes_no_datagram_of_another_type(loop, host, start, peer, framing):
    # The buffer has room for the 100 messages of the last lane, but not for 3000 CAMs.
    driver = start(LANED, framing=framing, listen="127.0.0.1:0", receive_buffer=150_000)
    encode = FRAMINGS[framing]
    others = [encode(bytes([2, number]) + CAM[2:]) for number in OTHERS]
    for number in range(3000):
        peer.sendto(encode(CAM), driver.address)
        if number % 60 == 0:
            for other in others:
                peer.sendto(other, driver.address)
    driver.refresh()
    dropped = host.drops[Reason.KERNEL_QUEUE]
    assert 0 < dropped < 3000
    loop.run_until(lambda: host.count == 3000 + 50 * len(OTHERS) - dropped)
    assert sorted(pdu[1] for pdu in host.pdus if pdu[1] != 2) == sorted(OTHERS * 50)
    driver.refresh()
    assert host.drops == {Reason.KERNEL_QUEUE: dropped}


def test_denms_wait_for_two_slices_of_all_other_types_together(loop, host, start, peer):
    driver = start(LANED, listen="127.0.0.1:0")
    others = [bytes([2, number]) + CAM[2:] for number in (2, 4, 5, 6, 9, 10, 14, 16, 20, 77) for _ in range(7)]
    for message in [*others, DENM]:
        peer.sendto(message, driver.address)
    loop.run_until(lambda: host.count == 71)
    assert host.pdus.index(DENM) < 16


def test_what_was_dropped_before_a_stop_is_counted_by_the_stop(loop, host, start, peer):
    driver = start(listen="127.0.0.1:0", receive_buffer=4096)
    for _ in range(1000):
        peer.sendto(CAM, driver.address)
    driver.stop()
    assert 900 < host.drops[Reason.KERNEL_QUEUE] < 1000


class Unprivileged(socket.socket):
    """Socket of a process without CAP_NET_ADMIN."""

    def setsockopt(self, level, option, value):
        if option == SO_RCVBUFFORCE:
            raise PermissionError
        super().setsockopt(level, option, value)


def test_a_smaller_buffer_than_asked_for_is_said():
    with Unprivileged(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        assert enlarge(receiver, 100_000) == ""
        assert enlarge(receiver, 4096) == ""
        assert receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) == 8192
        assert "instead of 268435456 octets: raise net.core.rmem_max" in enlarge(receiver, 268_435_456)


def test_a_port_that_is_taken_is_said_even_where_the_kernel_would_share_it(host, start, peer):
    driver = start(listen="127.0.0.1:0")
    with pytest.raises(InterfaceError, match="port already taken") as failure:
        start(listen=str(driver.address))
    assert "ss -ulpn" in failure.value.hint


def test_an_address_of_another_host_cannot_be_listened_at(start):
    with pytest.raises(InterfaceError, match=r"cannot listen at 192\.0\.2\.1:8947"):
        start(listen="192.0.2.1:8947")


@pytest.mark.parametrize("table", [
    {"listen": "localhost:8947"}, {"listen": "127.0.0.1"}, {"listen": "127.0.0.1:65536"}, {"listen": "127.0.0.1:-1"},
    {"listen": ":8947"}, {"peers": ["127.0.0.1:x"]}, {"group": "127.0.0.1:8947"}, {}, {"device": "eth0"},
    {"listen": "127.0.0.1:0", "framing": "vanetza"}, {"listen": "127.0.0.1:0", "receive_buffer": 1},
])  # fmt: skip
def test_options_that_cannot_be_meant_are_refused_with_their_place(table):
    with pytest.raises(ConfigurationError, match=r"captain\.toml"):
        read(UdpOptions, table, "captain.toml")


def test_each_option_that_cannot_be_meant_is_told_with_its_key():
    table = {"listen": "localhost:1", "peers": ["x", "127.0.0.1:1", "y"], "group": "10.0.0.1:1", "device": "a/b"}
    with pytest.raises(ConfigurationError) as refused:
        read(UdpOptions, table, "captain.toml")
    assert refused.value.message.split("\n") == [
        'captain.toml: listen: invalid IPv4 address and port: "localhost:1"; write for example 127.0.0.1:8947',
        'captain.toml: peers: invalid IPv4 address and port: "x"; write for example 127.0.0.1:8947',
        'captain.toml: peers: invalid IPv4 address and port: "y"; write for example 127.0.0.1:8947',
        'captain.toml: group: not a multicast group: "10.0.0.1:1"; groups are 224.0.0.0 to 239.255.255.255',
        'captain.toml: device: invalid name of a network device: "a/b"; `ip -brief link` lists them',
    ]


@pytest.mark.parametrize(("options", "can"), [
    ({"listen": "127.0.0.1:0"}, Can.RECEIVE), ({"peers": ("127.0.0.1:1",)}, Can.TRANSMIT),
    ({"group": "239.118.122.97:8947"}, Can.RECEIVE | Can.TRANSMIT),
])  # fmt: skip
def test_it_declares_what_its_options_let_it_do(options, can):
    assert Udp(UdpOptions(**options, framing="pdu"), SHARED).capabilities.can == can


@pytest.mark.parametrize(("framing", "octets"), [("pdu", 1500), ("btp", 1500), ("ethernet", 1500)])
def test_it_carries_what_its_framing_does(framing, octets):
    capabilities = Udp(UdpOptions(group=GROUP, framing=framing), SHARED).capabilities
    assert capabilities.max_payload == octets
    assert (Can.GEOBROADCAST in capabilities.can) is (framing == "ethernet")


def test_an_interface_that_only_listens_sends_no_geobroadcasts():
    assert Udp(UdpOptions(listen="127.0.0.1:0"), SHARED).capabilities.can == Can.RECEIVE


def test_an_interface_without_peers_refuses_requests(host, start):
    driver = start(listen="127.0.0.1:0")
    with pytest.raises(RequestError, match="only listens"):
        driver.send(request(CAM))


def test_an_absent_peer_is_said_once_and_takes_no_message_from_the_others(loop, host, start, peer):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        absent = text(gone)
    driver = start(peers=(absent, text(peer)))
    for number in range(5):
        assert driver.send(request(CAM, number)) is Sent.NOW
    assert [peer.recv(2048) for _ in range(5)] == [CAM] * 5
    assert [why for _, why in host.links[1:]] == [f"{absent} refuses: no program listens there"]
    loop.run_for(6)
    driver.refresh()
    assert host.links[-1] == host.links[0]


def test_a_peer_that_returns_gets_the_next_message(start, peer):
    address = peer.getsockname()
    driver = start(peers=(text(peer),))
    peer.close()
    for number in range(3):
        driver.send(request(CAM, number))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as back:
        back.bind(address)
        back.settimeout(2)
        driver.send(request(DENM))
        assert back.recv(2048) == DENM


def test_the_traffic_class_is_the_class_selector_of_every_datagram_without_privilege(start, peer):
    other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    other.bind(("127.0.0.1", 0))
    driver = start(peers=(text(peer), text(other)))
    for one in (peer, other):
        one.setsockopt(socket.IPPROTO_IP, socket.IP_RECVTOS, 1)
    for traffic_class, tos in {2: 0, 0: 0xE0, 1: 0xA0, 3: 0x20, 0x82: 0, 63: 0}.items():
        driver.send(request(CAM)._replace(traffic_class=traffic_class))
        for one in (peer, other):
            (_, _, octets), *_ = one.recvmsg(2048, 64)[1]
            assert octets[0] == tos
    other.close()


def _veth():
    ip("link add v2x0 type veth peer name air0")
    ip("addr add 10.0.0.1/24 dev v2x0")
    ip("link set v2x0 up")
    ip("link set air0 up")
    wait_for_carrier("v2x0")


GROUP = "239.118.122.97:8947"


@pytest.mark.namespace
@pytest.mark.parametrize("framing", ["pdu", "btp", "ethernet"])
def test_two_stations_of_one_host_hear_each_other_in_a_group_and_not_themselves(loop, framing):
    hosts = [Host(loop), Host(loop)]
    options = UdpOptions(framing=framing, group=GROUP, device="lo", beacon_s=0.0)
    drivers = [Udp(options, SHARED._replace(mac=bytes([2, 0, 0, 0, 0, number]))) for number in range(2)]
    for driver, host in zip(drivers, hosts, strict=True):
        driver.start(host)
    drivers[0].send(request(CAM))
    loop.run_until(lambda: hosts[1].total)
    drivers[1].send(request(DENM))  # its own copy of the CAM came before this
    loop.run_until(lambda: hosts[0].total)
    assert (hosts[0].pdus, hosts[0].drops) == ([DENM], {})
    assert (hosts[1].pdus, hosts[1].drops) == ([CAM], {})


@pytest.mark.namespace
def test_a_group_without_a_route_asks_for_a_device(host):
    with pytest.raises(InterfaceError) as failure:
        Udp(UdpOptions(group=GROUP), SHARED).start(host)
    assert "route" in str(failure.value)


@pytest.mark.namespace
def test_a_device_that_goes_down_or_away_is_noticed(loop, host):
    _veth()
    driver = Udp(UdpOptions(framing="pdu", group=GROUP, device="v2x0"), SHARED)
    driver.start(host)
    assert host.is_up
    ip("link set v2x0 down")
    told(loop, lambda: not host.is_up)
    ip("link set v2x0 up")
    told(loop, lambda: host.is_up)
    assert driver.send(request(CAM)) is Sent.NOW
    ip("link del v2x0")
    told(loop, lambda: host.failures)
    assert str(host.failures[0]) == "network device v2x0 is gone"


def test_an_error_of_the_receiving_socket_ends_the_driver_with_its_name(host, start, monkeypatch):
    driver = start(listen="127.0.0.1:0")
    driver._sockets._broken(OSError(errno.ENETDOWN, os.strerror(errno.ENETDOWN)))
    assert str(host.failures[0]) == "receiving: network is down"
