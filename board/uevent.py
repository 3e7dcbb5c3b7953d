"""Hot-plug: the kernel's uevents as a Source."""

import errno
import os
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import NamedTuple

from board.machine import Machine
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop

# Constants of linux/netlink.h and lib/kobject_uevent.c; group 2 is udev's.
NETLINK_KOBJECT_UEVENT = 15
GROUP_KERNEL = 1
SO_RCVBUFFORCE = 33  # asm-generic/socket.h: lets root exceed net.core.rmem_max

# A modem causes 20 messages of 2 KiB at once, and up to four modems start together; this holds ten times as many.
RECEIVE_BUFFER = 2 << 20
LONGEST = 8192  # octets; the kernel's buffer (UEVENT_BUFFER_SIZE) has 2048, and the path precedes its content

BATCH = 64  # most messages read in one turn


class Uevent(NamedTuple):
    """Change of one device.

    action      add, remove, change, bind, unbind, move, online, offline.
    devpath     path of the device below /sys.
    subsystem   usb, tty, net, ...
    properties  all variables of the message: DEVTYPE, DEVNAME, PRODUCT, INTERFACE, SEQNUM, ...
    """

    action: str
    devpath: str
    subsystem: str
    properties: Mapping[str, str]


def parse(octets: bytes) -> Uevent | None:
    """Parse a message of the kernel: `add@/devices/...`, then KEY=VALUE, each ended by NUL; None if it is not one.

    Source: lib/kobject_uevent.c, kobject_uevent_env(). Messages of udev begin with `libudev` and are not parsed.
    """
    head, *rest = octets.decode("utf-8", "surrogateescape").split("\0")
    action, _, devpath = head.partition("@")
    if rest and not rest[-1]:  # after the last NUL
        rest.pop()
    properties = dict(text.partition("=")[::2] for text in rest if "=" in text)
    if len(properties) != len(rest) or not devpath.startswith("/"):
        return None
    if (properties.get("ACTION"), properties.get("DEVPATH")) != (action, devpath):
        return None
    return Uevent(action, devpath, properties.get("SUBSYSTEM", ""), properties)


class Uevents:
    """Calls on_event() with each change of a device.

    on_event  receives the change, or None if messages were lost: then look at all devices again.
    """

    def __init__(self, loop: Loop, machine: Machine, on_event: Callable[[Uevent | None], None]) -> None:
        """Start to listen. Raises InterfaceError if the kernel's messages cannot be received."""
        self._loop = loop
        self._machine = machine
        self._on_event = on_event
        self.ignored = 0  # number of messages that are not uevents of the kernel
        self.missed = 0  # number of times that messages were lost
        self._socket = self._open()
        loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        for _ in range(BATCH):
            if self.fileno() < 0:  # on_event() called close()
                return
            try:
                octets, sender = self._socket.recvfrom(LONGEST)
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno == errno.ENOBUFS:
                    self._miss()
                    continue
                octets = b""
            if not octets:
                self._lose()
                return
            self._take(octets, sender)

    def close(self) -> None:
        """Stop listening; idempotent."""
        if self.fileno() >= 0:
            self._loop.remove(self)
            self._socket.close()

    def _take(self, octets: bytes, sender: object) -> None:
        # A netlink sender has a port number: 0 is the kernel, any other a program.
        event = parse(octets) if not isinstance(sender, tuple) or sender[0] == 0 else None
        if event is None:
            self.ignored += 1
        else:
            self._on_event(event)

    def _miss(self) -> None:
        self.missed += 1
        self._on_event(None)

    def _lose(self) -> None:
        """Reconnect after a simulated kernel closed the connection, as it does if this side reads too slowly."""
        self._loop.remove(self)
        self._socket.close()
        with suppress(InterfaceError):
            self._socket = self._open()
            self._loop.add(self)
        self._miss()

    def _open(self) -> socket.socket:
        path = self._machine.uevents
        family, kind = (socket.AF_UNIX, socket.SOCK_SEQPACKET) if path else (socket.AF_NETLINK, socket.SOCK_DGRAM)
        opened = socket.socket(family, kind | socket.SOCK_NONBLOCK, 0 if path else NETLINK_KOBJECT_UEVENT)
        try:
            if path:
                opened.connect(path)
            else:
                _enlarge(opened)
                opened.bind((0, GROUP_KERNEL))
        except OSError as error:
            opened.close()
            why = os.strerror(error.errno or 0).lower()
            raise InterfaceError(
                f"uevents{path and f' at {path}'}: cannot listen: {why}", "hot-plug is not detected"
            ) from error
        return opened


def _enlarge(opened: socket.socket) -> None:
    try:
        opened.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER)
    except PermissionError:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
