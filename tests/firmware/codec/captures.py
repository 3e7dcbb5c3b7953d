"""Captures made of frames, octet for octet as the drafts of pcap and pcapng say."""

import struct
from collections.abc import Iterable

WHEN_NS = 1795182426_461613000


def pcap(frames: Iterable[bytes], order: str = "<", magic: int = 0xA1B2C3D4, link: int = 1) -> bytes:
    """All at WHEN_NS; magic 0xa1b23c4d counts nanoseconds, the other microseconds."""
    fraction = WHEN_NS % 10**9 // (1 if magic == 0xA1B23C4D else 1000)
    head = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link)
    records = (struct.pack(order + "IIII", WHEN_NS // 10**9, fraction, len(one), len(one)) + one for one in frames)
    return head + b"".join(records)


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    body += bytes(-len(body) % 4)
    return struct.pack(order + "II", kind, len(body) + 12) + body + struct.pack(order + "I", len(body) + 12)


def section(order: str = "<") -> bytes:
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(link: int = 1, order: str = "<", options: bytes = b"", snap_length: int = 0) -> bytes:
    return block(1, struct.pack(order + "HHI", link, 0, snap_length) + options, order)


def enhanced(frame: bytes, ticks: int, order: str = "<", index: int = 0) -> bytes:
    head = struct.pack(order + "IIIII", index, ticks >> 32, ticks & 0xFFFFFFFF, len(frame), len(frame))
    return block(6, head + frame + bytes(-len(frame) % 4), order)


def simple(frame: bytes, order: str = "<") -> bytes:
    return block(3, struct.pack(order + "I", len(frame)) + frame, order)


def pcapng(frames: Iterable[bytes], order: str = "<", link: int = 1) -> bytes:
    """In microseconds, as most programs write it."""
    return section(order) + interface(link, order) + b"".join(enhanced(one, WHEN_NS // 1000, order) for one in frames)
