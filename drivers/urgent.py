"""Urgent messages get a socket of their own: classic BPF programs that tell them by type, in the kernel.

A queue that is full of CAMs then costs no DENM, and the station reads the urgent socket first. A program only
chooses between two sockets, it judges nothing: what it cannot follow goes where everything else goes.
"""

import ctypes
import socket
import struct
from collections.abc import Iterable
from typing import NamedTuple

# Numbers of asm-generic/socket.h that the socket module does not name.
SO_ATTACH_FILTER = 26
SO_ATTACH_REUSEPORT_CBPF = 51


class Instruction(NamedTuple):
    """struct sock_filter of linux/filter.h: if_true and if_false are instructions to skip."""

    code: int
    if_true: int = 0
    if_false: int = 0
    k: int = 0


class Verdict(NamedTuple):
    """What a program returns for an urgent message, and for any other."""

    urgent: int
    other: int


Program = list[Instruction]

# A reuseport program returns the index of a socket in its group, in the order they were bound.
SOCKET_INDEX = Verdict(urgent=0, other=1)
# A socket filter returns how many octets to keep, 0 for none.
KEEP_URGENT = Verdict(urgent=0xFFFF, other=0)
KEEP_OTHER = Verdict(urgent=0, other=0xFFFF)

LOAD_LENGTH = 0x80  # BPF_LD | BPF_W | BPF_LEN
LOAD_OCTET, LOAD_HALF, LOAD_WORD = 0x30, 0x28, 0x20  # BPF_LD | BPF_ABS
LOAD_OCTET_X, LOAD_HALF_X = 0x50, 0x48  # BPF_LD | BPF_IND: at X + k
SET_X, TAX, TXA = 0x01, 0x07, 0x87
AND, ADD, SUBTRACT, SHIFT_RIGHT = 0x54, 0x04, 0x14, 0x74
EQUAL, AT_LEAST, AT_LEAST_X = 0x15, 0x35, 0x3D
RETURN = 0x06

# linux/filter.h, SKF_AD_OFF + SKF_AD_PKTTYPE, as an unsigned offset; linux/if_packet.h.
PACKET_TYPE = 0xFFFFF000 + 4
PACKET_OTHERHOST = 3

# Octets of the GeoNetworking extended header by header type (EN 302 636-4-1 V1.4.1, table 9 and clause 9.8):
# GUC 2, GAC 3, GBC 4, TSB and SHB 5. The others carry no message.
EXTENDED_HEADER = {5: 28, 4: 44, 3: 44, 2: 48}


def by_octet(values: Iterable[int], verdict: Verdict, at: int = 1) -> Program:
    """Urgent by one octet: messageID of the ITS PDU header in a bare PDU."""
    return [
        *_if_longer(at, verdict),
        Instruction(LOAD_OCTET, k=at),
        *_any_of(values, verdict),
        Instruction(RETURN, k=verdict.other),
    ]


def by_port(ports: Iterable[int], verdict: Verdict) -> Program:
    """Urgent by the destination port at the start of a BTP header."""
    return [
        *_if_longer(1, verdict),
        Instruction(LOAD_HALF),
        *_any_of(ports, verdict),
        Instruction(RETURN, k=verdict.other),
    ]


def by_frame(ports: Iterable[int], verdict: Verdict) -> Program:
    """Urgent by the BTP port in an Ethernet frame with GeoNetworking, secured or not."""
    return [
        *_if_longer(14 + 4 + 8, verdict),
        Instruction(LOAD_HALF, k=12),
        Instruction(EQUAL, 1, 0, 0x8947),
        Instruction(RETURN, k=verdict.other),
        *_skip_security_envelope(),
        *_skip_extended_header(verdict),
        Instruction(LOAD_HALF_X),
        *_any_of(ports, verdict),
        Instruction(RETURN, k=verdict.other),
    ]


def not_for_others(program: Program) -> Program:
    """A socket filter that rejects what is addressed to other stations before its program looks at it.

    A device that somebody made promiscuous, or that has no address filter, hands such frames to raw sockets.
    """
    return [
        Instruction(LOAD_WORD, k=PACKET_TYPE),
        Instruction(EQUAL, 0, 1, PACKET_OTHERHOST),
        Instruction(RETURN),
        *program,
    ]


def steer(group_socket: socket.socket, program: Program) -> None:
    """Let a program choose the socket of a SO_REUSEPORT group; its data starts at the UDP payload."""
    _attach(group_socket, SO_ATTACH_REUSEPORT_CBPF, program)


def keep(packet_socket: socket.socket, program: Program) -> None:
    """Let a program choose which frames a socket keeps; its data starts at the Ethernet header."""
    _attach(packet_socket, SO_ATTACH_FILTER, program)


def _if_longer(octets: int, verdict: Verdict) -> Program:
    # A load beyond the end ends a program with 0: two filters would both reject the frame, and nobody count it.
    return [
        Instruction(LOAD_LENGTH),
        Instruction(AT_LEAST, 1, 0, octets + 1),
        Instruction(RETURN, k=verdict.other),
    ]


def _if_longer_than_x(octets: int, verdict: Verdict) -> Program:
    return [
        Instruction(LOAD_LENGTH),
        Instruction(SUBTRACT, k=octets + 1),
        Instruction(AT_LEAST_X, 1, 0),
        Instruction(RETURN, k=verdict.other),
    ]


def _any_of(values: Iterable[int], verdict: Verdict) -> Program:
    # A return behind every comparison keeps all jumps short: they are one octet wide.
    return [
        instruction
        for value in sorted(values)
        for instruction in (Instruction(EQUAL, 0, 1, value), Instruction(RETURN, k=verdict.urgent))
    ]


def _skip_security_envelope() -> Program:
    """X becomes what stands between the basic and the common header: nothing, or the start of an envelope.

    The envelope of TS 103 097 V1.3.1 starts with 03 81 00 40 03 80 and a COER length of one octet, or of 1 + n
    octets where the first is 0x80 + n (Rec. ITU-T X.696, clause 8.6).
    """
    return [
        Instruction(SET_X),
        Instruction(LOAD_OCTET, k=14),
        Instruction(AND, k=0x0F),
        Instruction(EQUAL, 0, 6, 2),  # next header of the basic header: 1 common header, 2 secured packet
        Instruction(LOAD_OCTET, k=14 + 4 + 6),
        Instruction(AT_LEAST, 1, 0, 0x80),
        Instruction(AND),  # a length below 128 is in its first octet: n is 0
        Instruction(AND, k=0x7F),
        Instruction(ADD, k=7),
        Instruction(TAX),
    ]


def _skip_extended_header(verdict: Verdict) -> Program:
    """X, until now the length of the envelope, becomes the offset of the BTP header in the frame."""
    program = [
        *_if_longer_than_x(14 + 4 + 1, verdict),
        Instruction(LOAD_OCTET_X, k=14 + 4 + 1),
        Instruction(SHIFT_RIGHT, k=4),
    ]
    remaining = len(EXTENDED_HEADER)
    for header_type, octets in EXTENDED_HEADER.items():
        remaining -= 1
        # Each row is four instructions; the last of them skips the rows that follow and the return behind them.
        program += [
            Instruction(EQUAL, 0, 3, header_type),
            Instruction(TXA),
            Instruction(ADD, k=14 + 4 + 8 + octets),
            Instruction(EQUAL, 4 * remaining + 1, 4 * remaining + 1),
        ]
    return [
        *program,
        Instruction(RETURN, k=verdict.other),
        Instruction(TAX),
        *_if_longer_than_x(1, verdict),
    ]


def _attach(target: socket.socket, option: int, program: Program) -> None:
    octets = b"".join(struct.pack("=HBBI", *instruction) for instruction in program)
    buffer = ctypes.create_string_buffer(octets, len(octets))
    # struct sock_fprog; the kernel has copied the program when setsockopt returns.
    target.setsockopt(socket.SOL_SOCKET, option, struct.pack("HP", len(program), ctypes.addressof(buffer)))
