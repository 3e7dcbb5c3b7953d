"""RawRxMessage decoder for tests, by section 3 of the contract, without the station's code."""

from typing import Any

# UPER, unaligned: each field has as many bits as its range needs, and contains its distance from the lower bound.
SIGNED_32 = (32, -(1 << 31))
POSITION = (("latitude", *SIGNED_32), ("longitude", *SIGNED_32))
TIME = (("sec", *SIGNED_32), ("usec", *SIGNED_32))
RX_INFO = (
    *TIME,
    ("rssi", 16, -32768),
    ("data_rate", 16, 0),
    ("traffic_class", 8, 0),
    ("hop_limit", 8, 0),
    ("security_status", 2, 0),
    ("its_aid", 22, 0),  # 0..2113663
    ("ssp_len", 8, 0),
    ("ssp", 256, 0),
    *POSITION,
    ("area_type", 2, 0),
    ("distance_a", 16, 0),
    ("distance_b", 16, 0),
    ("angle", 16, 0),
    ("mac", 48, 0),
    ("payload_size", 11, 0),
)
OVERHEAD = 74  # octets, without localInfo


def decode(octets: bytes) -> dict[str, Any]:
    """Return all fields by name: `local` is None or a dict, `pdu` the payload. Check that the rest is padding."""
    bits = _Bits(octets)
    has_local, has_payload = bits.take(1), bits.take(1)
    local = _fields(bits, TIME + POSITION) if has_local else None
    fields = _fields(bits, RX_INFO)
    fields["ssp"] = fields["ssp"].to_bytes(32, "big")
    fields["mac"] = fields["mac"].to_bytes(6, "big")
    length = bits.take(11) + 1 if has_payload else 0
    fields["pdu"] = bits.take(8 * length).to_bytes(length, "big")
    assert bits.left < 8, f"{bits.left} bits are left over"
    assert bits.take(bits.left) == 0, "padding is not zero"
    return fields | {"local": local}


def _fields(bits: "_Bits", layout: tuple[tuple[str, int, int], ...]) -> dict[str, Any]:
    return {name: bits.take(width) + lowest for name, width, lowest in layout}


class _Bits:
    def __init__(self, octets: bytes) -> None:
        self._value = int.from_bytes(octets, "big")
        self.left = 8 * len(octets)

    def take(self, width: int) -> int:
        self.left -= width
        assert self.left >= 0, "RawRxMessage ends too early"
        return self._value >> self.left & ((1 << width) - 1)
