"""GeoLink on a medium of bare packets, as drivers/README.md describes it."""

from drivers.contract import NOW, Sent
from drivers.packet.geolink import GeoLink
from drivers.wire import frame
from drivers.wire.geonet.header import Address, BasicHeader, CommonHeader, HeaderType, LongPosition
from drivers.wire.geonet.packet import LocationRequest, Packet, encode, parse
from tests.drivers.host import CAM, MAC, SHARED, Host, request
from tests.virtual import VirtualLoop

SPEAKER = bytes.fromhex("02000000000b")


class Medium:
    """Station on a medium without addresses: packets have no Ethernet header."""

    def __init__(self, loop: VirtualLoop, mac: bytes) -> None:
        self.host = Host(loop)
        self.sent: list[bytes] = []
        self._link = GeoLink(self.host, SHARED, mac, 0.0, self._transmit)

    def receive(self, packet: bytes) -> None:
        extended = parse(packet).extended
        assert extended is not None
        self._link.receive(frame.wrap(extended.source.address.mac, packet), 0)

    def packet(self, pdu: bytes) -> bytes:
        return self._link.encode(request(pdu))[frame.HEADER :]

    def _transmit(self, octets: bytes) -> Sent:
        self.sent.append(octets[frame.HEADER :])
        return NOW


def test_geolink_with_bare_packets_indicates_a_pdu_of_the_packets_source_without_doubt(loop):
    speaker, listener = Medium(loop, SPEAKER), Medium(loop, MAC)
    listener.receive(speaker.packet(CAM))
    ((pdu, _, rx),) = listener.host.indications
    assert (pdu, rx.implausible, rx.source_mac) == (CAM, (), SPEAKER)


def test_geolink_with_bare_location_request_answers(loop):
    source = LongPosition(Address(True, 5, 0, SPEAKER), 0, 0, 0, True, 0, 0)
    common = CommonHeader(0, 0, HeaderType.LS_REQUEST, 0, 0x80, 0, 1)
    asked = encode(
        Packet(BasicHeader(1, 1, 0, 0x1A, 1), common, LocationRequest(1, 0, source, Address(True, 0, 0, MAC)), b"")
    )
    listener = Medium(loop, MAC)
    listener.receive(asked)
    assert len(listener.sent) == 1
    assert listener.host.neighbours == [SPEAKER]
