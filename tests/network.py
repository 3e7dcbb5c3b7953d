"""Network of a test process: its own loopback, so that no port is shared with another program."""

import ctypes
import fcntl
import os
import socket
import struct
from pathlib import Path

CLONE_NEWUSER = 0x10000000  # unshare(2)
CLONE_NEWNET = 0x40000000
SIOCSIFFLAGS = 0x8914  # netdevice(7)
IFF_UP = 1
CAPABILITY_VERSION_3 = 0x20080522  # capget(2)

_libc = ctypes.CDLL(None, use_errno=True)


def isolate(*, as_root: bool = False) -> None:
    """Move this process and its later children into a new network namespace with an active loopback.

    as_root  True makes the process root in the namespace, so that it may create network devices. False keeps the user,
             without capabilities.

    Call this before any thread starts. Raises OSError if the kernel does not permit it: user_namespaces(7).
    """
    user, group = os.geteuid(), os.getegid()
    inner_user, inner_group = (0, 0) if as_root else (user, group)
    is_root = user == 0
    if _libc.unshare(CLONE_NEWNET | (0 if is_root else CLONE_NEWUSER)):
        raise _failure("unshare")
    if not is_root:
        maps = ("uid_map", f"{inner_user} {user} 1"), ("gid_map", f"{inner_group} {group} 1")
        for name, text in (("setgroups", "deny"), *maps):
            Path("/proc/self", name).write_text(text, encoding="ascii")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        fcntl.ioctl(one, SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", IFF_UP))
    if not is_root and not as_root:
        _drop_capabilities()


def _drop_capabilities() -> None:
    """Drop all capabilities, which a new user namespace grants. Otherwise unreadable files would be readable in tests."""
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION_3, 0)
    none = (ctypes.c_uint32 * 6)()
    if _libc.capset(header, none):
        raise _failure("capset")


def _failure(call: str) -> OSError:
    number = ctypes.get_errno()
    return OSError(number, f"{call}: {os.strerror(number)}")
