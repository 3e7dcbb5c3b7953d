"""UBX messages about the receiver's state: MON-VER, MON-RF, SEC-SIG. Their payloads have repeated blocks.

Source: u-blox F9 HPG 1.32 and 1.50 interface descriptions, clause 3.
"""

from struct import Struct
from typing import NamedTuple

from board.runtime.errors import ProtocolError

_VERSIONS = Struct("<30s10s")
_EXTENSION = 30  # octets of an extension
_RF_HEADER = Struct("<BB2x")
_RF_BLOCK = Struct("<BBBBI4xHHBbBbB3x")
_SIGNALS_1 = Struct("<B3xB3xB3x")
_SIGNALS_2 = Struct("<BBxB")
_FREQUENCY = Struct("<I")


class MonVer(NamedTuple):
    """Model and firmware of the receiver."""

    software: str
    hardware: str
    extensions: tuple[str, ...] = ()

    @property
    def firmware(self) -> str:
        """Firmware version, such as `HPG 1.32`; the software version for older firmware without FWVER."""
        return self.extension("FWVER") or self.software

    @property
    def module(self) -> str:
        """Name of the module, such as `ZED-F9P`, or empty."""
        return self.extension("MOD")

    @property
    def protocol(self) -> str:
        """Protocol version, such as `27.31`, or empty."""
        return self.extension("PROTVER")

    def extension(self, name: str) -> str:
        """Return the value of the extension `NAME=value`, or empty; older firmware writes a space in place of `=`."""
        for one in self.extensions:
            if one.startswith(name) and one[len(name) : len(name) + 1] in ("=", " "):
                return one[len(name) + 1 :].strip()
        return ""

    @classmethod
    def unpack(cls, payload: bytes) -> "MonVer":
        """Decode a payload of UBX-MON-VER. Raises ProtocolError if it is shorter than its fixed part."""
        if len(payload) < _VERSIONS.size:
            raise ProtocolError(f"MON-VER of {len(payload)} octets: it has at least {_VERSIONS.size}")
        starts = range(_VERSIONS.size, len(payload) - _EXTENSION + 1, _EXTENSION)
        software, hardware = _VERSIONS.unpack_from(payload)
        return cls(_text(software), _text(hardware), tuple(_text(payload[at : at + _EXTENSION]) for at in starts))

    def pack(self) -> bytes:
        extensions = b"".join(one.encode("ascii").ljust(_EXTENSION, b"\0") for one in self.extensions)
        return _VERSIONS.pack(self.software.encode("ascii"), self.hardware.encode("ascii")) + extensions


class RfBlock(NamedTuple):
    """State of one RF path of MON-RF."""

    block: int
    flags: int
    antenna: int  # 0 starting, 1 unknown, 2 ok, 3 short circuit, 4 open
    power: int  # power of the antenna: 0 off, 1 on, 2 unknown
    post: int = 0
    noise: int = 0
    gain: int = 0
    jamming_indicator: int = 0  # 0 no narrow-band jamming ... 255 strong jamming
    offset_i: int = 0
    magnitude_i: int = 0
    offset_q: int = 0
    magnitude_q: int = 0

    @property
    def jamming(self) -> int:
        """Jamming state: 0 unknown, 1 none, 2 warning, 3 critical."""
        return self.flags & 3


class MonRf(NamedTuple):
    """State of the RF paths: jamming and antenna."""

    version: int
    blocks: tuple[RfBlock, ...]

    @classmethod
    def unpack(cls, payload: bytes) -> "MonRf":
        """Decode a payload of UBX-MON-RF.

        Raises ProtocolError if it is shorter than its header or its blocks.
        """
        version, count = _head(_RF_HEADER, payload, "MON-RF")
        if len(payload) < _RF_HEADER.size + count * _RF_BLOCK.size:
            raise ProtocolError(f"MON-RF of {len(payload)} octets is too short for {count} blocks")
        starts = range(_RF_HEADER.size, _RF_HEADER.size + count * _RF_BLOCK.size, _RF_BLOCK.size)
        return cls(version, tuple(RfBlock(*_RF_BLOCK.unpack_from(payload, at)) for at in starts))

    def pack(self) -> bytes:
        blocks = b"".join(_RF_BLOCK.pack(*block) for block in self.blocks)
        return _RF_HEADER.pack(self.version, len(self.blocks)) + blocks


class SecSig(NamedTuple):
    """Jamming and spoofing as detected by the receiver, for both versions of the message.

    jamming   0 unknown, 1 none, 2 warning, 3 critical.
    spoofing  0 unknown, 1 none, 2 indicated, 3 affirmed.
    centres   version 2: centre frequency in kHz in bits 0..23; bit 24 is set if it is jammed.
    """

    version: int
    is_jamming_detected: bool  # True if jamming detection is enabled
    jamming: int
    is_spoofing_detected: bool  # True if spoofing detection is enabled
    spoofing: int
    centres: tuple[int, ...] = ()

    @classmethod
    def unpack(cls, payload: bytes) -> "SecSig":
        """Decode a payload of UBX-SEC-SIG.

        Raises ProtocolError for other versions than 1 and 2, and for a truncated payload.
        """
        if payload[:1] == b"\x02":
            return cls._unpack_2(payload)
        version, jamming, spoofing = _head(_SIGNALS_1, payload, "SEC-SIG")
        if version != 1:
            raise ProtocolError(f"SEC-SIG of version {version}: only 1 and 2 are known")
        return cls(1, bool(jamming & 1), jamming >> 1 & 3, bool(spoofing & 1), spoofing >> 1 & 7)

    @classmethod
    def _unpack_2(cls, payload: bytes) -> "SecSig":
        version, flags, count = _head(_SIGNALS_2, payload, "SEC-SIG")
        if len(payload) < _SIGNALS_2.size + count * _FREQUENCY.size:
            raise ProtocolError(f"SEC-SIG of {len(payload)} octets is too short for {count} frequencies")
        starts = range(_SIGNALS_2.size, _SIGNALS_2.size + count * _FREQUENCY.size, _FREQUENCY.size)
        centres = tuple(_FREQUENCY.unpack_from(payload, at)[0] for at in starts)
        return cls(version, bool(flags & 1), flags >> 1 & 3, bool(flags & 8), flags >> 4 & 7, centres)

    def pack(self) -> bytes:
        jamming = self.is_jamming_detected | self.jamming << 1
        spoofing = self.is_spoofing_detected | self.spoofing << 1
        if self.version == 1:
            return _SIGNALS_1.pack(1, jamming, spoofing)
        centres = b"".join(map(_FREQUENCY.pack, self.centres))
        return _SIGNALS_2.pack(self.version, jamming | spoofing << 3, len(self.centres)) + centres


def _head(layout: Struct, payload: bytes, name: str) -> tuple[int, ...]:
    if len(payload) < layout.size:
        raise ProtocolError(f"{name} of {len(payload)} octets: it has at least {layout.size}")
    return layout.unpack_from(payload)


def _text(octets: bytes) -> str:
    return octets.partition(b"\0")[0].decode("ascii", "backslashreplace")
