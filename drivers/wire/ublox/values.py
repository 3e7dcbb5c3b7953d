"""Configuration messages of u-blox generation 9 receivers: CFG-VALSET and CFG-VALGET with keys and values.

Bits 28..30 of a key give the size of its value. A receiver accepts a CFG-VALSET as a whole. If one key is unknown, it
rejects the message with ACK-NAK, without naming the key.
Source: u-blox F9 HPG 1.32 interface description, clauses 3.10 and 6.
"""

from struct import Struct
from typing import NamedTuple

from board.runtime.errors import ProtocolError
from drivers.wire.ublox.keys import Key, key

# Layers of CFG-VALSET, as bits.
RAM, BBR, FLASH = 1, 2, 4
# Layers of CFG-VALGET, as numbers.
GET_RAM, GET_BBR, GET_FLASH, GET_DEFAULT = 0, 1, 2, 7

MAX_ITEMS = 64  # items per message

# Octets of a value by bits 28..30 of its key. Size 1 is a single bit, which occupies a whole octet.
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8}
_HEADER = Struct("<BBBB")
_KEY = Struct("<I")

Items = tuple[tuple[int, int], ...]


class ValSet(NamedTuple):
    """Message that sets keys in layers. The type of a key in keys.py decides if its value is signed."""

    layers: int
    items: Items
    version: int = 0
    transaction: int = 0  # version 1 only: 0 none, 1 begin, 2 continue, 3 apply

    @classmethod
    def unpack(cls, payload: bytes) -> "ValSet":
        """Decode a payload of UBX-CFG-VALSET. Raises ProtocolError if it is truncated."""
        version, layers, transaction, _ = _head(payload, "CFG-VALSET")
        return cls(layers, _unpack_items(payload), version, transaction)

    def pack(self) -> bytes:
        return _HEADER.pack(self.version, self.layers, self.transaction, 0) + _pack_items(self.items)


class ValGet(NamedTuple):
    """Request for the values of keys in one layer (version 0), or its answer (version 1).

    items  in a request: the keys, with a placeholder value of 0 that is not sent.
    """

    version: int
    layer: int
    items: Items
    position: int = 0  # number of values that the answer skips

    @classmethod
    def unpack(cls, payload: bytes) -> "ValGet":
        """Decode a payload of UBX-CFG-VALGET, a poll or its answer.

        Raises ProtocolError if it is truncated.
        """
        version, layer, low, high = _head(payload, "CFG-VALGET")
        if version:
            return cls(version, layer, _unpack_items(payload), low | high << 8)
        keys = payload[_HEADER.size :]
        if len(keys) % _KEY.size:
            raise ProtocolError(f"CFG-VALGET: truncated list of keys: {len(keys)} octets")
        return cls(0, layer, tuple((number, 0) for (number,) in _KEY.iter_unpack(keys)), low | high << 8)

    def pack(self) -> bytes:
        head = _HEADER.pack(self.version, self.layer, self.position & 0xFF, self.position >> 8)
        if self.version:
            return head + _pack_items(self.items)
        return head + b"".join(_KEY.pack(number) for number, _ in self.items)


def _head(payload: bytes, name: str) -> tuple[int, ...]:
    if len(payload) < _HEADER.size:
        raise ProtocolError(f"{name} of {len(payload)} octets: it has at least {_HEADER.size}")
    return _HEADER.unpack_from(payload)


def _pack_items(items: Items) -> bytes:
    assert len(items) <= MAX_ITEMS
    return b"".join(_KEY.pack(number) + pack_value(key(number), value) for number, value in items)


def _unpack_items(payload: bytes) -> Items:
    items: list[tuple[int, int]] = []
    at = _HEADER.size
    while at < len(payload):
        if at + _KEY.size > len(payload):
            raise ProtocolError(f"a configuration ends in the middle of a key, {len(payload) - at} octets of it")
        (number,) = _KEY.unpack_from(payload, at)
        end = at + _KEY.size + size(number)
        if end > len(payload):
            raise ProtocolError(f"a configuration ends in the middle of the value of {key(number).name}")
        items.append((number, unpack_value(key(number), payload[at + _KEY.size : end])))
        at = end
    return tuple(items)


def size(number: int) -> int:
    """Return the octets of a key's value. Raises ProtocolError for a key with an invalid size."""
    octets = _SIZES.get(number >> 28 & 7)
    if octets is None:
        raise ProtocolError(f"invalid key: {number:#010x}: unknown size in bits 28..30")
    return octets


def pack_value(one: Key, value: int) -> bytes:
    """Return the octets of a value, as they follow its key in a message."""
    octets = size(one.number)
    return value.to_bytes(octets, "little", signed=one.type == "I")


def unpack_value(one: Key, octets: bytes) -> int:
    """Decode the octets of a value; inverse of pack_value()."""
    return int.from_bytes(octets, "little", signed=one.type == "I")
