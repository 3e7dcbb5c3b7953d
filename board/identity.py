"""Who the board is: the ID EEPROM of a HAT, or what the Pi's firmware read of it into the device tree.

Format: Raspberry Pi HAT ID EEPROM format specification, version 1. Everything in it is little-endian.
"""

import struct
from pathlib import Path
from typing import NamedTuple

from board.errors import InterfaceError, ProtocolError

SIGNATURE = b"R-Pi"
HEADER = struct.Struct("<4sBxHI")  # signature, version, atoms, length of all
ATOM = struct.Struct("<HHI")  # type, number, length of data and CRC
VENDOR = struct.Struct("<16sHHBB")  # uuid, product id, product version, lengths of vendor and product
VENDOR_TYPE = 1
CRC = 2  # octets

# As far as the vendor atom can reach, which is always the first: 55 ms at 100 kHz, where all 4 KiB would take 370.
ENOUGH = HEADER.size + ATOM.size + VENDOR.size + 2 * 255 + CRC

POLYNOMIAL = 0xA001  # 0x8005 from its other end


class Identity(NamedTuple):
    """A board's identity; numbers as the device tree writes them, 0x0001.

    source  where it was read.
    """

    vendor: str
    product: str
    product_id: str
    product_ver: str
    uuid: str
    source: str


def of_eeprom(octets: bytes, source: str) -> Identity:
    """Read the beginning of an EEPROM, ENOUGH octets or less. Raises ProtocolError where it is no HAT's."""
    if octets[: len(SIGNATURE)] != SIGNATURE or len(octets) < HEADER.size:
        raise ProtocolError(f"{source}: begins with {octets[:4].hex(' ')}, not with R-Pi", "`eepmake` writes an image")
    _, version, atoms, _ = HEADER.unpack_from(octets)
    if version != 1:
        raise ProtocolError(f"{source}: the format has version {version}, not 1")
    if not atoms:
        raise ProtocolError(f"{source}: holds no atom")
    return _vendor(_first_atom(octets, source), source)


def of_device_tree(proc: Path) -> Identity | None:
    """What the firmware left in proc/device-tree/hat*/; None where there is nothing. Raises InterfaceError."""
    for directory in sorted((proc / "device-tree").glob("hat*")):
        if (directory / "vendor").exists() or (directory / "product").exists():
            return Identity._make([*(_property(directory / name) for name in Identity._fields[:-1]), str(directory)])
    return None


def crc16(octets: bytes) -> int:
    """CRC-16 with polynomial 0x8005, least significant bit first, from 0: 0xBB3D of `123456789`."""
    crc = 0
    for octet in octets:
        crc ^= octet
        for _ in range(8):
            crc = crc >> 1 ^ (POLYNOMIAL if crc & 1 else 0)
    return crc


def _first_atom(octets: bytes, source: str) -> bytes:
    """The data of the first atom, of which the CRC is right."""
    begin = HEADER.size + ATOM.size
    if len(octets) < begin:
        raise ProtocolError(f"{source}: ends after {len(octets)} octets, within its first atom")
    kind, _, length = ATOM.unpack_from(octets, HEADER.size)
    if kind != VENDOR_TYPE:
        raise ProtocolError(f"{source}: its first atom has type {kind}, not that of a vendor, 1")
    end = begin + length - CRC
    if length < CRC + VENDOR.size or end + CRC > len(octets):
        raise ProtocolError(f"{source}: an atom of {length} octets does not fit in the {len(octets) - begin} read")
    stored = int.from_bytes(octets[end : end + CRC], "little")
    computed = crc16(octets[HEADER.size : end])
    if stored != computed:
        raise ProtocolError(
            f"{source}: the CRC of its first atom is 0x{computed:04x} and stored as 0x{stored:04x}",
            "it was changed, or read wrongly: read it again, then write it anew",
        )
    return octets[begin:end]


def _vendor(data: bytes, source: str) -> Identity:
    uuid, product_id, version, vendor_length, product_length = VENDOR.unpack_from(data)
    end = VENDOR.size + vendor_length + product_length
    if end > len(data):
        raise ProtocolError(f"{source}: names of {vendor_length} and {product_length} octets exceed their atom")
    names = data[VENDOR.size : end]
    digits = uuid[::-1].hex()  # stored with its least significant octet first
    return Identity(
        vendor=_printable(names[:vendor_length]),
        product=_printable(names[vendor_length:]),
        product_id=f"0x{product_id:04x}",
        product_ver=f"0x{version:04x}",
        uuid="-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:])),
        source=source,
    )


def _property(path: Path) -> str:
    """A string of the device tree; empty where it is not given."""
    try:
        return _printable(path.read_bytes())
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise InterfaceError(f"{path}: {error.strerror}") from error


def _printable(octets: bytes) -> str:
    """ASCII up to the first NUL; what a terminal would obey becomes `?`."""
    text = octets.split(b"\0", 1)[0].decode("ascii", "replace")
    return "".join(character if " " <= character <= "~" else "?" for character in text)
