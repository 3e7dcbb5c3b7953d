"""The Ethernet header around GeoNetworking."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.reason import Reason
from drivers.wire.frame import BROADCAST, Ethernet, unwrap, wrap
from tests.drivers.wire.captured import FRAMES, OWN


def test_a_frame_goes_to_everybody():
    assert wrap(OWN, b"packet") == b"\xff" * 6 + OWN + b"\x89\x47packet"


@pytest.mark.parametrize("name", FRAMES)
def test_a_captured_frame_is_taken_apart_and_put_together_again(name):
    found = unwrap(FRAMES[name])
    assert isinstance(found, Ethernet)
    assert found.destination == BROADCAST
    assert found.source in (bytes.fromhex("02000000000a"), bytes.fromhex("02000000000b"))
    assert wrap(found.source, found.packet) == FRAMES[name]


@pytest.mark.parametrize("ethertype", ["0800", "88b5", "4789", "8100"])
def test_another_ethertype_is_not_geonetworking(ethertype):
    assert unwrap(bytes(12) + bytes.fromhex(ethertype) + bytes(50)) is Reason.NOT_GEONETWORKING


@pytest.mark.parametrize("octets", range(14))
def test_a_frame_without_its_whole_header_is_truncated(octets):
    assert unwrap(FRAMES["cam-shb"][:octets]) is Reason.TRUNCATED


@given(octets=st.binary(max_size=40))
@settings(deadline=None, max_examples=100)
def test_random_octets_are_a_frame_or_have_a_reason(octets):
    assert isinstance(unwrap(octets), Ethernet | Reason)
