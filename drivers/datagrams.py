"""Several datagrams by one system call: recvmmsg(2), which the socket module does not offer.

Each costs half of what it costs by recvmsg(), and a socket that gave few need not be asked again to know it is empty.
"""

import ctypes
import errno
import mmap
import os
import socket
import struct
from typing import Final, NamedTuple

LONGEST = 2048  # octets: the longest PDU, its headers and an 802.11p frame fit
TIMESPEC: Final = struct.Struct("@ll")
SOCKADDR_IN: Final = struct.Struct("=H2s4s")  # family, port, address; the rest of it is padding

CONTROL = socket.CMSG_SPACE(TIMESPEC.size)
PART = LONGEST + CONTROL + SOCKADDR_IN.size  # of a room's memory; a multiple of a pointer's size, as CONTROL is

_recvmmsg = ctypes.CDLL(None, use_errno=True).recvmmsg
_recvmmsg.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)


class _Slice(ctypes.Structure):
    """struct iovec"""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Message(ctypes.Structure):
    """struct msghdr"""

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
    """struct mmsghdr"""

    _fields_ = (("message", _Message), ("length", ctypes.c_uint))


# The end of a header: flags and length.
OUTCOME: Final = struct.Struct(f"@i{_Header.length.offset - _Message.flags.offset - 4}xI")


class Place(NamedTuple):
    """Where the parts of one datagram are: offsets in a room's memory, `outcome` in its headers."""

    octets: int
    stamp: int
    name: int
    outcome: int


class Room:
    """Room for the datagrams of one call; what is wanted after the next call has to be copied.

    memory  the datagrams, their stamps (TIMESPEC) and senders (SOCKADDR_IN). A slice of it is a copy.
    headers what became of each (OUTCOME).
    places  one for each datagram.
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
        """Receive what a non-blocking socket has: how many there are now in the first places. Raises OSError."""
        self.headers[:] = self._fresh  # the last call wrote into it what it used of each length
        count: int = _recvmmsg(descriptor, self._start, self._count, 0, None)
        if count >= 0:
            return count
        number = ctypes.get_errno()
        if number in (errno.EAGAIN, errno.EINTR):
            return 0
        raise OSError(number, os.strerror(number))

    def _place(self, number: int) -> Place:
        octets = number * PART
        control, name = octets + LONGEST, octets + LONGEST + CONTROL
        start = ctypes.addressof(ctypes.c_char.from_buffer(self.memory))
        one = self._slices[number]
        one.base, one.length = start + octets, LONGEST
        self._headers[number].message = _Message(
            start + name, SOCKADDR_IN.size, ctypes.addressof(one), 1, start + control, CONTROL, 0
        )
        outcome = number * ctypes.sizeof(_Header) + _Message.flags.offset
        return Place(octets, control + socket.CMSG_LEN(0), name, outcome)


def sockaddr(address: tuple[str, int]) -> bytes:
    """An IPv4 address and port as a room has them of each sender."""
    host, port = address
    return SOCKADDR_IN.pack(socket.AF_INET, port.to_bytes(2), socket.inet_aton(host))
