"""Lists of v2x_gw, such as CAMList: a std_msgs/Header and messages.

The gateway's lists contain one message each.
"""

import struct

from .errors import RefusedError

ENCAPSULATION = b"\0\1\0\0"  # CDR, little endian
STAMP = struct.Struct("<iII")  # seconds, nanoseconds, length of frame_id with its final zero
COUNT = struct.Struct("<I")
# Alignment of a message in the list. Its first field, protocolVersion, has 8 octets in this profile.
ALIGNMENT = 8


def wrap(cdr: bytes, stamp_ns: int, frame: bytes) -> bytes:
    """Return a list that contains one serialised message.

    stamp_ns  Unix time in ns for the header; negative becomes 0.
    frame     frame_id, without a zero octet.
    """
    seconds, nanoseconds = divmod(max(stamp_ns, 0), 10**9)
    head = STAMP.pack(seconds, nanoseconds, len(frame) + 1) + frame + b"\0"
    head += bytes(-len(head) % COUNT.size) + COUNT.pack(1)
    return ENCAPSULATION + head + bytes(-len(head) % ALIGNMENT) + cdr[len(ENCAPSULATION) :]


def unwrap(cdr: bytes) -> bytes:
    """Return the serialised message of a list.

    Raises RefusedError for octets that are not a list, or if it does not contain exactly one message.
    """
    octets = cdr[len(ENCAPSULATION) :]
    if cdr[: len(ENCAPSULATION)] != ENCAPSULATION or len(octets) < STAMP.size:
        raise RefusedError("foreign", "no list: the octets are not those of a std_msgs/Header in CDR, little endian")
    at = STAMP.size + STAMP.unpack_from(octets)[2]
    at += -at % COUNT.size
    if at + COUNT.size > len(octets):
        raise RefusedError("foreign", f"no list: frame_id ends at {at} of {len(octets)} octets")
    [count] = COUNT.unpack_from(octets, at)
    if count != 1:
        raise RefusedError("list", f"the list has {count} messages; only lists with one message are sent")
    at += COUNT.size
    return ENCAPSULATION + octets[at + -at % ALIGNMENT :]
