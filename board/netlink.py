"""Network devices: state, and changes reported by the kernel."""

import fcntl
import os
import socket
import struct
from collections.abc import Callable
from contextlib import ExitStack
from typing import NamedTuple

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop

# Constants of linux/if.h, linux/sockios.h and linux/rtnetlink.h.
IFF_UP, IFF_RUNNING = 0x1, 0x40
SIOCGIFFLAGS, SIOCGIFHWADDR, SIOCGIFINDEX = 0x8913, 0x8927, 0x8933
GROUP_LINK = 1

BATCH = 64  # most netlink messages read in one call of ready()


class NetworkDevice(NamedTuple):
    """Current state of a network device.

    number       the kernel's index; it changes if a device of the same name is created again.
    is_up        set up by an administrator.
    has_carrier  cable plugged, or radio associated.
    mac          6 octets; zeros if the device has no address.
    """

    number: int
    is_up: bool
    has_carrier: bool
    mac: bytes

    @property
    def is_usable(self) -> bool:
        return self.is_up and self.has_carrier


def device(name: str) -> NetworkDevice | None:
    """Look up a network device by name; None if absent. Raises OSError if no descriptor is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        return _device(asker, name)


class DeviceWatch:
    """Calls changed() when a network device changes: with its state, or None if it is gone or was created again.

    The kernel's messages only trigger a query of the state; their content is ignored. So they need no parser, and a
    message lost because the socket's buffer was full does no harm.
    """

    def __init__(self, loop: Loop, name: str, changed: Callable[[NetworkDevice | None], None]) -> None:
        """Start to watch. Raises InterfaceError if the kernel provides no netlink socket."""
        self._loop = loop
        self._name = name
        self._changed = changed
        with ExitStack() as opening:
            try:
                # The queries of the state work on any socket. They use this one, which saves a descriptor.
                self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_NONBLOCK, 0)
                opening.enter_context(self._socket)
                self._socket.bind((0, GROUP_LINK))
            except OSError as error:
                raise InterfaceError(f"{name}: cannot watch network devices: {error.strerror}") from error
            self._state = _device(self._socket, name)
            loop.add(self)
            opening.pop_all()

    @property
    def state(self) -> NetworkDevice | None:
        return self._state

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        for _ in range(BATCH):
            try:
                self._socket.recv(1, socket.MSG_TRUNC)
            except BlockingIOError:
                break
            except OSError:  # ENOBUFS: messages were lost
                continue
        self.look()

    def look(self) -> None:
        """Query the state, and call changed() if it differs from the last one."""
        before, now = self._state, _device(self._socket, self._name)
        if now == before:
            return
        is_another = now is not None and before is not None and now.number != before.number
        self._state = None if is_another else now
        self._changed(self._state)

    def close(self) -> None:
        """Stop watching; idempotent."""
        if self._socket.fileno() >= 0:
            self._loop.remove(self)
            self._socket.close()


def _device(asker: socket.socket, name: str) -> NetworkDevice | None:
    try:
        number = struct.unpack_from("=i", _ask(asker, SIOCGIFINDEX, name), 16)[0]
        flags = struct.unpack_from("=H", _ask(asker, SIOCGIFFLAGS, name), 16)[0]
        mac = _ask(asker, SIOCGIFHWADDR, name)[18:24]
    except OSError:  # ENODEV, ENXIO: the device may also disappear between two of these queries
        return None
    return NetworkDevice(number, bool(flags & IFF_UP), bool(flags & IFF_RUNNING), mac)


def _ask(asker: socket.socket, question: int, name: str) -> bytes:
    return fcntl.ioctl(asker, question, struct.pack("256s", os.fsencode(name)[:15]))
