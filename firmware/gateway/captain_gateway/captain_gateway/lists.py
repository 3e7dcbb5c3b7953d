"""Lists of v2x_gw, CAMList of CAM: a std_msgs/Header, and behind it messages, of which those here have one."""

import struct

from .errors import RefusedError

ENCAPSULATION = b"\0\1\0\0"  # CDR, little endian
STAMP = struct.Struct("<iII")  # seconds, nanoseconds, octets of frame_id with the zero behind it
COUNT = struct.Struct("<I")
# Where a message begins: its first number, protocolVersion of the header, has 8 octets in this profile.
ALIGNMENT = 8


def wrap(cdr: bytes, stamp_ns: int, frame: bytes) -> bytes:
    """A serialised message as the list of it. frame: without a zero in it."""
    seconds, nanoseconds = divmod(max(stamp_ns, 0), 10**9)
    head = STAMP.pack(seconds, nanoseconds, len(frame) + 1) + frame + b"\0"
    head += bytes(-len(head) % COUNT.size) + COUNT.pack(1)
    return ENCAPSULATION + head + bytes(-len(head) % ALIGNMENT) + cdr[len(ENCAPSULATION) :]


def unwrap(cdr: bytes) -> bytes:
    """The serialised message of a list of one. Raises RefusedError."""
    octets = cdr[len(ENCAPSULATION) :]
    if cdr[: len(ENCAPSULATION)] != ENCAPSULATION or len(octets) < STAMP.size:
        raise RefusedError("foreign", "no list: the octets are not those of a std_msgs/Header in CDR, little endian")
    at = STAMP.size + STAMP.unpack_from(octets)[2]
    at += -at % COUNT.size
    if at + COUNT.size > len(octets):
        raise RefusedError("foreign", f"no list: frame_id ends at {at} of {len(octets)} octets")
    [count] = COUNT.unpack_from(octets, at)
    if count != 1:
        raise RefusedError("list", f"{count} messages are in the list: one in each is sent")
    at += COUNT.size
    return ENCAPSULATION + octets[at + -at % ALIGNMENT :]
