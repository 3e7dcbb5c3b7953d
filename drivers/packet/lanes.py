"""Lanes: one socket for each message type, selected by BPF programs in the kernel.

Because each type has its own queue, a queue full of CAMs does not cause the loss of a DENM, SPATEM or VAM. A program
only selects the lane by messageID. Unknown or unreadable packets go to the last lane.
"""

import ctypes
import socket
import struct
from collections.abc import Sequence
from typing import NamedTuple

# Numbers of asm-generic/socket.h and linux/if_packet.h that the socket module does not name.
SO_ATTACH_FILTER = 26
SO_ATTACH_REUSEPORT_CBPF = 51
SOL_PACKET = 263
PACKET_FANOUT, PACKET_FANOUT_DATA = 18, 22
PACKET_FANOUT_CBPF, PACKET_FANOUT_FLAG_UNIQUEID = 6, 0x2000


class Instruction(NamedTuple):
    """One BPF instruction: struct sock_filter of linux/filter.h.

    if_true, if_false  number of instructions to skip after a comparison that is true or false.
    """

    code: int
    if_true: int = 0
    if_false: int = 0
    k: int = 0


Program = list[Instruction]

# messageIDs of each lane. The last lane, which takes everything else, is not listed.
Lanes = Sequence[frozenset[int]]

LOAD_LENGTH = 0x80  # BPF_LD | BPF_W | BPF_LEN
LOAD_OCTET, LOAD_HALF, LOAD_WORD = 0x30, 0x28, 0x20  # BPF_LD | BPF_ABS
LOAD_OCTET_X = 0x50  # BPF_LD | BPF_IND: at X + k
SET_X, TAX, TXA = 0x01, 0x07, 0x87
AND, ADD, SUBTRACT, SHIFT_RIGHT = 0x54, 0x04, 0x14, 0x74
EQUAL, AT_LEAST, AT_LEAST_X = 0x15, 0x35, 0x3D
RETURN = 0x06

# Offset at which a program loads the packet type: SKF_AD_OFF + SKF_AD_PKTTYPE of linux/filter.h, as an unsigned number.
# PACKET_OTHERHOST of linux/if_packet.h is the type of a frame addressed to another host.
PACKET_TYPE = 0xFFFFF000 + 4
PACKET_OTHERHOST = 3

ETHERNET = 14  # octets of the Ethernet header; the last two are the EtherType
BASIC, COMMON, BTP = 4, 8, 4  # octets of the GeoNetworking basic and common headers, and of the BTP header
MESSAGE_ID = 1  # offset of messageID in the ITS PDU header (TS 102 894-2 v2.4.1, DF ItsPduHeader)

# Octets of the GeoNetworking extended header by header type: GUC 2, GAC 3, GBC 4, TSB and SHB 5. Other header types
# carry no message. Source: EN 302 636-4-1 V1.4.1, table 9 and clause 9.8.
EXTENDED_HEADER = {5: 28, 4: 44, 3: 44, 2: 48}

# A socket filter returns the number of octets to keep; 0 discards the packet.
ALL: Program = [Instruction(RETURN, k=0xFFFF)]
NONE: Program = [Instruction(RETURN)]
# Filter that discards frames addressed to other hosts. Raw sockets get such frames if the device has no address filter,
# or if another program has made it promiscuous.
NOT_FOR_OTHERS: Program = [
    Instruction(LOAD_WORD, k=PACKET_TYPE),
    Instruction(EQUAL, 0, 1, PACKET_OTHERHOST),
    *NONE,
    *ALL,
]


def in_pdu(lanes: Lanes, start: int = 0) -> Program:
    """Return a program that selects the lane of a PDU; the PDU starts at octet `start` of the packet."""
    return [
        *_if_longer(start + MESSAGE_ID, lanes),
        Instruction(LOAD_OCTET, k=start + MESSAGE_ID),
        *_choose(lanes),
    ]


def in_btp(lanes: Lanes) -> Program:
    """Return a program that selects the lane of a PDU after a BTP header."""
    return in_pdu(lanes, BTP)


def in_frame(lanes: Lanes) -> Program:
    """Return a program that selects the lane of a PDU in an Ethernet frame with GeoNetworking, secured or not."""
    return [
        *_if_longer(ETHERNET, lanes),
        Instruction(LOAD_HALF, k=ETHERNET - 2),
        Instruction(EQUAL, 1, 0, 0x8947),
        _last(lanes),
        *in_packet(lanes, ETHERNET),
    ]


def in_packet(lanes: Lanes, start: int = 0) -> Program:
    """Return a program that selects the lane of a PDU in a GeoNetworking packet, which starts at octet `start`."""
    return [
        *_if_longer(start + BASIC + COMMON, lanes),
        *_skip_security_envelope(start, lanes),
        *_skip_extended_header(start, lanes),
        *_if_longer_than_x(BTP + MESSAGE_ID, lanes),
        Instruction(LOAD_OCTET_X, k=BTP + MESSAGE_ID),
        *_choose(lanes),
    ]


def steer(group_socket: socket.socket, program: Program) -> None:
    """Let a program select the socket of a SO_REUSEPORT group for each datagram.

    group_socket  any socket of the group.
    program       reads the UDP payload; returns the index of a socket, in the order of bind().
    """
    _attach(group_socket, socket.SOL_SOCKET, SO_ATTACH_REUSEPORT_CBPF, program)


def fan_out(packet_sockets: Sequence[socket.socket], program: Program) -> None:
    """Let a program select one of several bound raw sockets for each frame.

    packet_sockets  sockets in the order in which they were opened. When a device goes down, the kernel removes its
                    sockets from the group; when it comes up, they join again in that order.
    program         reads the octets after the MAC header; returns the index of a socket.

    The sockets form a new group: the kernel chooses a number that is unused in this network namespace. Raises OSError
    if the device is down (EINVAL, before Linux 6.13).
    """
    group = (PACKET_FANOUT_CBPF | PACKET_FANOUT_FLAG_UNIQUEID) << 16
    for one in packet_sockets:
        one.setsockopt(SOL_PACKET, PACKET_FANOUT, group)
        group = one.getsockopt(SOL_PACKET, PACKET_FANOUT)
    _attach(packet_sockets[0], SOL_PACKET, PACKET_FANOUT_DATA, program)


def keep(packet_socket: socket.socket, program: Program) -> None:
    """Attach a program that selects the frames that a socket keeps; it replaces the socket's earlier program."""
    _attach(packet_socket, socket.SOL_SOCKET, SO_ATTACH_FILTER, program)


def _last(lanes: Lanes) -> Instruction:
    return Instruction(RETURN, k=len(lanes))


def _choose(lanes: Lanes) -> Program:
    # Each comparison is followed by its own return, so jumps stay short: a jump distance has one octet.
    program = [
        instruction
        for lane, numbers in enumerate(lanes)
        for number in sorted(numbers)
        for instruction in (Instruction(EQUAL, 0, 1, number), Instruction(RETURN, k=lane))
    ]
    return [*program, _last(lanes)]


def _if_longer(octets: int, lanes: Lanes) -> Program:
    # A load beyond the end of the packet would end the program with 0, the urgent lane. So the length is checked first.
    return [Instruction(LOAD_LENGTH), Instruction(AT_LEAST, 1, 0, octets + 1), _last(lanes)]


def _if_longer_than_x(octets: int, lanes: Lanes) -> Program:
    return [
        Instruction(LOAD_LENGTH),
        Instruction(SUBTRACT, k=octets + 1),
        Instruction(AT_LEAST_X, 1, 0),
        _last(lanes),
    ]


def _skip_security_envelope(start: int, lanes: Lanes) -> Program:
    """Set X to the number of envelope octets between the basic and the common header; 0 in an unsecured packet.

    The envelope of TS 103 097 V1.3.1 starts with 03 81 00 40 03 80, then a COER length (Rec. ITU-T X.696, clause 8.6).
    The length has one octet, or 1 + n octets if the first one is 0x80 + n. The envelope of V1.2.1 starts with 02 and
    has its header fields before the payload. It is rare, so such packets simply go to the last lane.
    """
    return [
        Instruction(SET_X),
        Instruction(LOAD_OCTET, k=start),
        Instruction(AND, k=0x0F),
        Instruction(EQUAL, 0, 9, 2),  # next header of the basic header: 1 common header, 2 secured packet
        Instruction(LOAD_OCTET, k=start + BASIC),
        Instruction(EQUAL, 1, 0, 3),
        _last(lanes),
        Instruction(LOAD_OCTET, k=start + BASIC + 6),
        Instruction(AT_LEAST, 1, 0, 0x80),
        Instruction(AND),  # AND with 0 gives n = 0: a length below 128 has no further octets
        Instruction(AND, k=0x7F),
        Instruction(ADD, k=7),
        Instruction(TAX),
    ]


def _skip_extended_header(start: int, lanes: Lanes) -> Program:
    """Set X, until now the length of the envelope, to the offset of the BTP header."""
    program = [
        *_if_longer_than_x(start + BASIC + 1, lanes),
        Instruction(LOAD_OCTET_X, k=start + BASIC + 1),
        Instruction(SHIFT_RIGHT, k=4),
    ]
    remaining = len(EXTENDED_HEADER)
    for header_type, octets in EXTENDED_HEADER.items():
        remaining -= 1
        # Each row has four instructions. The last one skips the rows that follow and the return after them.
        program += [
            Instruction(EQUAL, 0, 3, header_type),
            Instruction(TXA),
            Instruction(ADD, k=start + BASIC + COMMON + octets),
            Instruction(EQUAL, 4 * remaining + 1, 4 * remaining + 1),
        ]
    return [*program, _last(lanes), Instruction(TAX)]


def _attach(target: socket.socket, level: int, option: int, program: Program) -> None:
    octets = b"".join(struct.pack("=HBBI", *instruction) for instruction in program)
    buffer = ctypes.create_string_buffer(octets, len(octets))
    # struct sock_fprog. The kernel copies the program before setsockopt() returns, so the buffer may be freed then.
    target.setsockopt(level, option, struct.pack("HP", len(program), ctypes.addressof(buffer)))
