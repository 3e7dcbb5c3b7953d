"""Network devices that come, go and lose their carrier: told by the kernel, not polled."""

import fcntl
import os
import socket
import struct
from collections.abc import Callable
from contextlib import ExitStack
from typing import NamedTuple

from board.errors import InterfaceError
from board.loop import Loop

# Numbers of linux/if.h, linux/sockios.h and linux/rtnetlink.h.
IFF_UP, IFF_RUNNING = 0x1, 0x40
SIOCGIFFLAGS, SIOCGIFHWADDR, SIOCGIFINDEX = 0x8913, 0x8927, 0x8933
GROUP_LINK = 1

BATCH = 64  # netlink messages read in one turn


class Device(NamedTuple):
    """A network device as it is now.

    number      the kernel's index: changes when a device of the same name is made again.
    is_up       set up by an administrator.
    has_carrier cable plugged, radio joined.
    mac         6 octets; zero where the device has none.
    """

    number: int
    is_up: bool
    has_carrier: bool
    mac: bytes

    @property
    def is_usable(self) -> bool:
        return self.is_up and self.has_carrier


def device(name: str) -> Device | None:
    """Look a network device up by its name; None where there is none. Raises OSError without a free descriptor."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        return _device(asker, name)


class DeviceWatch:
    """Calls when a network device changes: with the new state, or None when it is gone or was made again.

    The kernel's messages only say when to look: what they hold is asked for afresh. So none has to be parsed, and
    one that was lost because the socket's buffer was full does not matter.
    """

    def __init__(self, loop: Loop, name: str, changed: Callable[[Device | None], None]) -> None:
        """Watch from now on. Raises InterfaceError where the kernel gives no netlink socket."""
        self._loop = loop
        self._name = name
        self._changed = changed
        with ExitStack() as opening:
            try:
                # Any socket answers the questions: this one does, so that a look needs no further descriptor.
                self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_NONBLOCK, 0)
                opening.enter_context(self._socket)
                self._socket.bind((0, GROUP_LINK))
            except OSError as error:
                raise InterfaceError(f"{name}: cannot watch network devices: {error.strerror}") from error
            self._state = _device(self._socket, name)
            loop.add(self)
            opening.pop_all()

    @property
    def state(self) -> Device | None:
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
        """Ask for the state now, and call if it is another one."""
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


def _device(asker: socket.socket, name: str) -> Device | None:
    try:
        number = struct.unpack_from("=i", _ask(asker, SIOCGIFINDEX, name), 16)[0]
        flags = struct.unpack_from("=H", _ask(asker, SIOCGIFFLAGS, name), 16)[0]
        mac = _ask(asker, SIOCGIFHWADDR, name)[18:24]
    except OSError:  # ENODEV, ENXIO: it may also go between two of these questions
        return None
    return Device(number, bool(flags & IFF_UP), bool(flags & IFF_RUNNING), mac)


def _ask(asker: socket.socket, question: int, name: str) -> bytes:
    return fcntl.ioctl(asker, question, struct.pack("256s", os.fsencode(name)[:15]))
