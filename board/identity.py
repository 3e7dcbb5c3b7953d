"""Board identity: from a HAT's ID EEPROM or the device tree.

Format: Raspberry Pi HAT ID EEPROM format specification, version 1. Everything in it is little-endian.
"""

import struct
from pathlib import Path
from typing import NamedTuple

from board.runtime.errors import InterfaceError, ProtocolError

SIGNATURE = b"R-Pi"
HEADER = struct.Struct("<4sBxHI")  # signature, version, number of atoms, total length
ATOM = struct.Struct("<HHI")  # type, number, length of data and CRC
VENDOR = struct.Struct("<16sHHBB")  # uuid, product id, product version, lengths of the vendor's and product's names
VENDOR_TYPE = 1
CRC = 2  # octets

# Largest end of the vendor atom, which is always the first. At 100 kHz, it takes 55 ms; the whole 4 KiB would take 370.
ENOUGH = HEADER.size + ATOM.size + VENDOR.size + 2 * 255 + CRC

POLYNOMIAL = 0xA001  # 0x8005 with its bits reversed


class Identity(NamedTuple):
    """Identity of a board. Numbers have the form of the device tree: 0x0001.

    vendor       name of the vendor.
    product      name of the product.
    product_id   number of the product.
    product_ver  version of the product.
    uuid         unique identifier.
    source       device or file that it was read from.
    """

    vendor: str
    product: str
    product_id: str
    product_ver: str
    uuid: str
    source: str


def of_eeprom(octets: bytes, source: str) -> Identity:
    """Parse the first octets of an EEPROM, at most ENOUGH. Raises ProtocolError if they are not a HAT's."""
    if octets[: len(SIGNATURE)] != SIGNATURE or len(octets) < HEADER.size:
        raise ProtocolError(f"{source}: begins with {octets[:4].hex(' ')}, not with R-Pi", "`eepmake` writes an image")
    _, version, atoms, _ = HEADER.unpack_from(octets)
    if version != 1:
        raise ProtocolError(f"{source}: the format has version {version}, not 1")
    if not atoms:
        raise ProtocolError(f"{source}: has no atom")
    return _vendor(_first_atom(octets, source), source)


def of_device_tree(proc: Path) -> Identity | None:
    """Return the identity that the firmware left in proc/device-tree/hat*/; None if it left none.

    Raises InterfaceError if a property cannot be read.
    """
    for directory in sorted((proc / "device-tree").glob("hat*")):
        if (directory / "vendor").exists() or (directory / "product").exists():
            return Identity._make([*(_property(directory / name) for name in Identity._fields[:-1]), str(directory)])
    return None


def crc16(octets: bytes) -> int:
    """Return the CRC-16 with polynomial 0x8005, least significant bit first, initially 0: 0xBB3D for `123456789`."""
    crc = 0
    for octet in octets:
        crc ^= octet
        for _ in range(8):
            crc = crc >> 1 ^ (POLYNOMIAL if crc & 1 else 0)
    return crc


def _first_atom(octets: bytes, source: str) -> bytes:
    """Return the data of the first atom. Raises ProtocolError if it is truncated, of another type, or its CRC wrong."""
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
            "it was changed or misread: read it again, then write it again",
        )
    return octets[begin:end]


def _vendor(data: bytes, source: str) -> Identity:
    uuid, product_id, version, vendor_length, product_length = VENDOR.unpack_from(data)
    end = VENDOR.size + vendor_length + product_length
    if end > len(data):
        raise ProtocolError(f"{source}: names of {vendor_length} and {product_length} octets exceed their atom")
    names = data[VENDOR.size : end]
    digits = uuid[::-1].hex()  # the EEPROM stores the least significant octet first
    return Identity(
        vendor=_printable(names[:vendor_length]),
        product=_printable(names[vendor_length:]),
        product_id=f"0x{product_id:04x}",
        product_ver=f"0x{version:04x}",
        uuid="-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:])),
        source=source,
    )


def _property(path: Path) -> str:
    """Return a string of the device tree; empty if it is absent."""
    try:
        return _printable(path.read_bytes())
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise InterfaceError(f"{path}: {error.strerror}") from error


def _printable(octets: bytes) -> str:
    """Return the ASCII text up to the first NUL; control characters, which a terminal would obey, become `?`."""
    text = octets.split(b"\0", 1)[0].decode("ascii", "replace")
    return "".join(character if " " <= character <= "~" else "?" for character in text)
