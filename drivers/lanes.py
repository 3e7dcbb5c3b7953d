"""Every message type gets a socket of its own, a lane: classic BPF programs that tell types apart in the kernel.

A queue that is full of CAMs then costs no DENM, no SPATEM and no VAM. A program only chooses the lane by messageID,
it judges nothing: what it does not know or cannot follow goes to the last lane, behind those of the types.
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
    """struct sock_filter of linux/filter.h: if_true and if_false are instructions to skip."""

    code: int
    if_true: int = 0
    if_false: int = 0
    k: int = 0


Program = list[Instruction]

# messageIDs of each lane; the last lane, for everything else, is not among them.
Lanes = Sequence[frozenset[int]]

LOAD_LENGTH = 0x80  # BPF_LD | BPF_W | BPF_LEN
LOAD_OCTET, LOAD_HALF, LOAD_WORD = 0x30, 0x28, 0x20  # BPF_LD | BPF_ABS
LOAD_OCTET_X = 0x50  # BPF_LD | BPF_IND: at X + k
SET_X, TAX, TXA = 0x01, 0x07, 0x87
AND, ADD, SUBTRACT, SHIFT_RIGHT = 0x54, 0x04, 0x14, 0x74
EQUAL, AT_LEAST, AT_LEAST_X = 0x15, 0x35, 0x3D
RETURN = 0x06

# linux/filter.h, SKF_AD_OFF + SKF_AD_PKTTYPE, as an unsigned offset; linux/if_packet.h.
PACKET_TYPE = 0xFFFFF000 + 4
PACKET_OTHERHOST = 3

ETHERNET = 14  # octets of the header; the EtherType is the last two
BASIC, COMMON, BTP = 4, 8, 4  # octets of the headers of GeoNetworking and BTP
MESSAGE_ID = 1  # its place in the ITS PDU header (TS 102 894-2 v2.4.1, DF ItsPduHeader)

# Octets of the GeoNetworking extended header by header type (EN 302 636-4-1 V1.4.1, table 9 and clause 9.8):
# GUC 2, GAC 3, GBC 4, TSB and SHB 5. The others carry no message.
EXTENDED_HEADER = {5: 28, 4: 44, 3: 44, 2: 48}

# A socket filter returns how many octets to keep.
ALL: Program = [Instruction(RETURN, k=0xFFFF)]
NONE: Program = [Instruction(RETURN)]
# A device that somebody made promiscuous, or that has no address filter, hands such frames to raw sockets.
NOT_FOR_OTHERS: Program = [
    Instruction(LOAD_WORD, k=PACKET_TYPE),
    Instruction(EQUAL, 0, 1, PACKET_OTHERHOST),
    *NONE,
    *ALL,
]


def in_pdu(lanes: Lanes, start: int = 0) -> Program:
    """The lane of a PDU that has `start` octets before it."""
    return [
        *_if_longer(start + MESSAGE_ID, lanes),
        Instruction(LOAD_OCTET, k=start + MESSAGE_ID),
        *_choose(lanes),
    ]


def in_btp(lanes: Lanes) -> Program:
    """The lane of a PDU behind a BTP header."""
    return in_pdu(lanes, BTP)


def in_frame(lanes: Lanes) -> Program:
    """The lane of a PDU in an Ethernet frame with GeoNetworking, secured or not."""
    return [
        *_if_longer(ETHERNET, lanes),
        Instruction(LOAD_HALF, k=ETHERNET - 2),
        Instruction(EQUAL, 1, 0, 0x8947),
        _last(lanes),
        *in_packet(lanes, ETHERNET),
    ]


def in_packet(lanes: Lanes, start: int = 0) -> Program:
    """The lane of a PDU in a GeoNetworking packet that has `start` octets before it."""
    return [
        *_if_longer(start + BASIC + COMMON, lanes),
        *_skip_security_envelope(start, lanes),
        *_skip_extended_header(start, lanes),
        *_if_longer_than_x(BTP + MESSAGE_ID, lanes),
        Instruction(LOAD_OCTET_X, k=BTP + MESSAGE_ID),
        *_choose(lanes),
    ]


def steer(group_socket: socket.socket, program: Program) -> None:
    """Let a program choose the socket of a SO_REUSEPORT group, counted as they were bound; it sees UDP payloads."""
    _attach(group_socket, socket.SOL_SOCKET, SO_ATTACH_REUSEPORT_CBPF, program)


def fan_out(packet_sockets: Sequence[socket.socket], program: Program) -> None:
    """Let a program choose one of these bound raw sockets for each frame; it sees what follows the MAC header.

    The group is one of its own: the kernel finds a number that no other group of this network namespace has.
    A device that goes down takes its sockets out of the group. When it comes up they return as they were opened, so
    the order here must be that of opening. Raises OSError when the device is down (EINVAL, before Linux 6.13).
    """
    group = (PACKET_FANOUT_CBPF | PACKET_FANOUT_FLAG_UNIQUEID) << 16
    for one in packet_sockets:
        one.setsockopt(SOL_PACKET, PACKET_FANOUT, group)
        group = one.getsockopt(SOL_PACKET, PACKET_FANOUT)
    _attach(packet_sockets[0], SOL_PACKET, PACKET_FANOUT_DATA, program)


def keep(packet_socket: socket.socket, program: Program) -> None:
    """Let a program choose which frames a socket keeps, in place of the one before."""
    _attach(packet_socket, socket.SOL_SOCKET, SO_ATTACH_FILTER, program)


def _last(lanes: Lanes) -> Instruction:
    return Instruction(RETURN, k=len(lanes))


def _choose(lanes: Lanes) -> Program:
    # A return behind every comparison keeps all jumps short: they are one octet wide.
    program = [
        instruction
        for lane, numbers in enumerate(lanes)
        for number in sorted(numbers)
        for instruction in (Instruction(EQUAL, 0, 1, number), Instruction(RETURN, k=lane))
    ]
    return [*program, _last(lanes)]


def _if_longer(octets: int, lanes: Lanes) -> Program:
    # A load beyond the end ends a program with 0, which is the urgent lane.
    return [Instruction(LOAD_LENGTH), Instruction(AT_LEAST, 1, 0, octets + 1), _last(lanes)]


def _if_longer_than_x(octets: int, lanes: Lanes) -> Program:
    return [
        Instruction(LOAD_LENGTH),
        Instruction(SUBTRACT, k=octets + 1),
        Instruction(AT_LEAST_X, 1, 0),
        _last(lanes),
    ]


def _skip_security_envelope(start: int, lanes: Lanes) -> Program:
    """X becomes what stands between the basic and the common header: nothing, or the start of an envelope.

    The envelope of TS 103 097 V1.3.1 starts with 03 81 00 40 03 80 and a COER length of one octet, or of 1 + n
    octets where the first is 0x80 + n (Rec. ITU-T X.696, clause 8.6). That of V1.2.1, which starts with 02, has its
    header fields before the payload: it is rare, and the last lane is good enough.
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
        Instruction(AND),  # a length below 128 is in its first octet: n is 0
        Instruction(AND, k=0x7F),
        Instruction(ADD, k=7),
        Instruction(TAX),
    ]


def _skip_extended_header(start: int, lanes: Lanes) -> Program:
    """X, until now the length of the envelope, becomes the offset of the BTP header."""
    program = [
        *_if_longer_than_x(start + BASIC + 1, lanes),
        Instruction(LOAD_OCTET_X, k=start + BASIC + 1),
        Instruction(SHIFT_RIGHT, k=4),
    ]
    remaining = len(EXTENDED_HEADER)
    for header_type, octets in EXTENDED_HEADER.items():
        remaining -= 1
        # Each row is four instructions; the last of them skips the rows that follow and the return behind them.
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
    # struct sock_fprog; the kernel has copied the program when setsockopt returns.
    target.setsockopt(level, option, struct.pack("HP", len(program), ctypes.addressof(buffer)))
