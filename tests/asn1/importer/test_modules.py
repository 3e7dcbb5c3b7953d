"""Our own module describes what the endpoint puts on the wire: the octets of existing boxes."""

from typing import Any

import asn1tools  # type: ignore[import-untyped]
import pytest

from asn1.importer.editions import MODULES

# What an existing box sent: the PDU 02 02 00 00 05 39 00 01 02 03, first with nothing known of its reception.
NOTHING_KNOWN = (
    "6000000020000000200000000000000000000000000000000000000000000000000000000000000000000000000000000000200000002000"
    "000000000000000000000000000000140240808000014e40004080c0"
)
RECEIVED = (
    "7ac013d6a001c2cb5fee40030080400000000000000000000000000000000000000000000000000000000000000000000000270323aa224d"
    "c09000000000000000102030405060140240808000014e40004080c0"
)


@pytest.fixture(scope="module")
def container() -> Any:
    return asn1tools.compile_files(str(MODULES / "VC-Container.asn"), "uper")


@pytest.mark.parametrize("octets", [NOTHING_KNOWN, RECEIVED])
def test_a_message_of_an_existing_box_comes_back_unchanged(container: Any, octets: str) -> None:
    value = container.decode("RawRxMessage", bytes.fromhex(octets))
    assert value["payloadString"] == bytes.fromhex("02020000053900010203")
    assert container.encode("RawRxMessage", value).hex() == octets


def test_every_field_of_a_received_message_is_where_it_belongs(container: Any) -> None:
    received = container.decode("RawRxMessage", bytes.fromhex(RECEIVED))["rxInfo"]
    assert received["timestamp"] == {"sec": 1795182426, "usec": 461613}
    assert (received["rssi"], received["dataRate"]) == (-71, 12)
    assert (received["trafficClassID"], received["remainHopLimit"]) == (2, 1)
    assert received["positionInfo"] == {"latitude": 470585000, "longitude": 154600000}
    assert received["sourceMacAddress"].hex() == "010203040506"
