"""Reception of several datagrams by one system call, recvmmsg(2), which Python's socket module lacks.

A datagram costs half as much as by recvmsg(). If a call returns fewer datagrams than fit, the socket is empty: no other
call is needed to find that out.
"""

import ctypes
import errno
import mmap
import os
import socket
import struct
from typing import Final, NamedTuple

LONGEST = 2048  # octets: enough for the longest PDU with its headers, and for an 802.11p frame
TIMESPEC: Final = struct.Struct("@ll")
SOCKADDR_IN: Final = struct.Struct("=H2s4s")  # struct sockaddr_in without padding: family, port, address

CONTROL = socket.CMSG_SPACE(TIMESPEC.size)
PART = LONGEST + CONTROL + SOCKADDR_IN.size  # octets of memory per datagram: a multiple of a pointer's size, as CONTROL

_recvmmsg = ctypes.CDLL(None, use_errno=True).recvmmsg
_recvmmsg.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)


class _Slice(ctypes.Structure):
    """struct iovec: start and length of a buffer."""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Message(ctypes.Structure):
    """struct msghdr: buffers of one datagram, its sender and control messages, and its flags."""

    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint),
        ("slices", ctypes.c_void_p),
        ("slice_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Header(ctypes.Structure):
    """struct mmsghdr: a struct msghdr, and the length of the received datagram."""

    _fields_ = (("message", _Message), ("length", ctypes.c_uint))


# Result of one datagram, at the end of its struct mmsghdr: flags and length.
OUTCOME: Final = struct.Struct(f"@i{_Header.length.offset - _Message.flags.offset - 4}xI")


class DatagramPlace(NamedTuple):
    """Offsets of the parts of one datagram in a Room: `outcome` in its headers, the others in its memory.

    octets   start of the datagram.
    stamp    start of its kernel time stamp (TIMESPEC).
    name     start of its sender's address (SOCKADDR_IN).
    outcome  start of its flags and length (OUTCOME).
    """

    octets: int
    stamp: int
    name: int
    outcome: int


class Room:
    """Buffers for the datagrams of one call. The next call overwrites them, so copy what you keep.

    memory   datagrams, their time stamps (TIMESPEC) and senders (SOCKADDR_IN). A slice of it is a copy.
    headers  struct mmsghdr of each datagram, with its flags and length (OUTCOME).
    places   offsets of each datagram's parts.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._headers = (_Header * count)()
        self._slices = (_Slice * count)()
        self._start = ctypes.addressof(self._headers)
        self.memory = mmap.mmap(-1, count * PART)
        self.headers = memoryview(self._headers).cast("B")
        self.places = [self._place(number) for number in range(count)]
        self._fresh = bytes(self.headers)

    def receive(self, descriptor: int) -> int:
        """Receive the datagrams that wait in a non-blocking socket; return their number, 0 if none waits.

        The datagrams are at the first places. Raises OSError if the kernel reports an error of the socket.
        """
        self.headers[:] = self._fresh  # the previous call overwrote the lengths of buffers with the lengths used
        count: int = _recvmmsg(descriptor, self._start, self._count, 0, None)
        if count >= 0:
            return count
        number = ctypes.get_errno()
        if number in (errno.EAGAIN, errno.EINTR):
            return 0
        raise OSError(number, os.strerror(number))

    def _place(self, number: int) -> DatagramPlace:
        octets = number * PART
        control, name = octets + LONGEST, octets + LONGEST + CONTROL
        start = ctypes.addressof(ctypes.c_char.from_buffer(self.memory))
        one = self._slices[number]
        one.base, one.length = start + octets, LONGEST
        self._headers[number].message = _Message(
            start + name, SOCKADDR_IN.size, ctypes.addressof(one), 1, start + control, CONTROL, 0
        )
        outcome = number * ctypes.sizeof(_Header) + _Message.flags.offset
        return DatagramPlace(octets, control + socket.CMSG_LEN(0), name, outcome)


def sockaddr(address: tuple[str, int]) -> bytes:
    """Return an IPv4 address and port in the form of the senders in Room.memory (SOCKADDR_IN)."""
    host, port = address
    return SOCKADDR_IN.pack(socket.AF_INET, port.to_bytes(2), socket.inet_aton(host))
