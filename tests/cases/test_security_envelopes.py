"""Security envelope of TS 103 097 V1.2.1 (GeoNetworking security version 2), as other stacks send it."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from drivers.message import RxInfo, Security, SecurityStatus
from drivers.packet.geolink import GeoLink
from drivers.reason import Reason
from firmware.recordings import layers
from tests.cases.test_geonetworking import frames_of
from tests.drivers.host import SHARED, Host
from tests.drivers.wire.captured import tshark
from tests.virtual import VirtualLoop

CASES = Path(__file__).parent
OWN = bytes.fromhex("02000000000d")
BASIC = 14 + 4  # Ethernet, basic header
ETHERNET = 1

DUMMY = bytes.fromhex((CASES / "gn-security-v2.hex").read_text().split("\n")[1])[:-6]  # without octets behind it
VANETZA = [one for one in frames_of("vanetza_certs2.pcap") if one[14] & 15 == 2]
WITH_CERTIFICATE = [one for one in VANETZA if one[BASIC + 4 : BASIC + 5] == b"\x02"]
WITH_DIGEST = [one for one in VANETZA if one not in WITH_CERTIFICATE]
UNVERIFIABLE = SecurityStatus.UNVERIFIABLE_PKT


def pdu_of(octets: bytes) -> bytes:
    """The CAM of 41 octets: all frames here have one, and the same headers in front of it."""
    start = octets.index(bytes.fromhex("07d10000 0202")) + 4
    return octets[start : start + 41]


class Station:
    """A link with GeoNetworking, and its host."""

    def __init__(self, loop: VirtualLoop, delivers: bool = True) -> None:
        self.host = Host(loop)
        shared = SHARED._replace(deliver_unverified=delivers)
        self.link = GeoLink(self.host, shared, OWN, 0.0, lambda octets: None)

    def receive(self, *frames: bytes) -> list[tuple[bytes, RxInfo]]:
        for octets in frames:
            self.link.receive(octets, 0)
        return [(pdu, rx) for pdu, _, rx in self.host.indications]


@pytest.fixture
def loop() -> Iterator[VirtualLoop]:
    with closing(VirtualLoop()) as loop:
        yield loop


def test_the_message_of_issue_115_is_delivered_as_unverifiable(loop: VirtualLoop) -> None:
    station = Station(loop)
    ((pdu, rx),) = station.receive(DUMMY)
    assert station.host.drops == {}
    assert pdu.hex().startswith("020200000001")
    assert pdu == pdu_of(DUMMY)
    assert (rx.security, rx.btp_port, rx.transport) == (Security(UNVERIFIABLE), 2001, "shb")


def test_octets_behind_the_envelope_are_left_out(loop: VirtualLoop) -> None:
    with_padding = bytes.fromhex((CASES / "gn-security-v2.hex").read_text().split("\n")[1])
    assert Station(loop).receive(with_padding) == Station(loop).receive(DUMMY)


def test_every_old_envelope_of_vanetza_is_delivered_as_unverifiable(loop: VirtualLoop) -> None:
    station = Station(loop)
    found = station.receive(*VANETZA)
    assert station.host.drops == {}
    assert len(found) == len(VANETZA) == 30
    assert len(WITH_CERTIFICATE) == 6
    for octets, (pdu, rx) in zip(VANETZA, found, strict=True):
        ssp = b"\x01\x00\x00" if octets in WITH_CERTIFICATE else b""
        assert rx.security == Security(UNVERIFIABLE, 36, ssp)
        assert (rx.btp_port, rx.hop_limit, rx.transport) == (2001, 1, "shb")
        assert pdu == pdu_of(octets)


def test_old_envelopes_are_opened_as_tshark_opens_them(loop: VirtualLoop, tmp_path: Path) -> None:
    # tshark 4.0 gives up in certificates with an ITS-AID of five octets; those with a digest it shows to their end.
    frames = [DUMMY, *WITH_DIGEST]
    found = Station(loop).receive(*frames)
    for (pdu, rx), fields in zip(found, tshark(frames, tmp_path), strict=True):
        assert (fields["geonw.sec.version"], fields["geonw.sec.pl_fld_type"]) == ("2", "1")
        assert int(fields.get("geonw.sec.app_id", "0")) == rx.security.its_aid
        assert int(fields["geonw.ch.plength"]) == len(pdu) + 4
        assert int(fields["btpb.dstport"]) == rx.btp_port
        assert (int(fields["geonw.src_pos.lat"]), int(fields["geonw.src_pos.long"])) == rx.position
        assert "_ws.malformed" not in fields


def test_old_envelopes_are_dropped_as_signed_where_that_is_wanted(loop: VirtualLoop) -> None:
    station = Station(loop, delivers=False)
    assert station.receive(DUMMY, *VANETZA) == []
    assert station.host.drops == {Reason.SECURED: 31}


@pytest.mark.parametrize("delivers", [True, False])
@pytest.mark.parametrize(
    ("at", "octet", "why"),
    [
        (BASIC, 1, "unknown version of the envelope: 1"),
        (BASIC, 4, "unknown version of the envelope: 4"),
        (BASIC + 18, 0, "unsecured payload (type 0)"),
        (BASIC + 18, 2, "encrypted payload (type 2)"),
        (BASIC + 18, 4, "encrypted payload (type 4)"),
        (BASIC + 18, 7, "unknown payload (type 7)"),
        (BASIC + 16, 130, "encrypted data"),
    ],
)
def test_encrypted_and_unknown_content_is_dropped_with_its_cause(
    loop: VirtualLoop, at: int, octet: int, why: str, delivers: bool
) -> None:
    station = Station(loop, delivers)
    octets = bytearray(DUMMY)
    octets[at] = octet
    assert station.receive(bytes(octets)) == []
    assert station.host.drops == {Reason.SECURED_FORMAT: 1}
    assert station.host.drop_details == [f"security: {why}"]


@pytest.mark.parametrize("octets", [DUMMY, WITH_CERTIFICATE[0], WITH_DIGEST[0]])
def test_an_old_envelope_cut_off_at_any_octet_is_dropped_with_its_cause(loop: VirtualLoop, octets: bytes) -> None:
    station = Station(loop)
    for cut in range(BASIC, len(octets)):
        assert station.receive(octets[:cut]) == []
    assert station.host.drops == {Reason.SECURED_FORMAT: len(octets) - BASIC}
    assert all(detail.startswith("security: ") for detail in station.host.drop_details)


@pytest.mark.parametrize("octets", [DUMMY, *VANETZA])
def test_the_message_in_an_old_envelope_is_found_by_the_commands(octets: bytes) -> None:
    carried = layers.open_frame(ETHERNET, octets)
    assert isinstance(carried, layers.Carried)
    assert (carried.pdu, carried.btp_port, carried.is_signed) == (pdu_of(octets), 2001, True)
