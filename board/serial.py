"""A serial port on the loop: opened without waiting, raw, for us alone, and never drained."""

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from board.errors import BlockedError, InterfaceError
from board.loop import READ, WRITE, Loop

if TYPE_CHECKING:
    from serial import Serial

TAKEN = (errno.EAGAIN, errno.EBUSY, errno.EACCES, errno.EPERM)  # by another program, or kept from us

BATCH = 4096  # octets read in one turn: a tty's queue holds no more


class SerialPort:
    """Octets in by a call, octets out at once or as soon as the line takes them.

    received  is given what came, at least one octet.
    broken    is told once that the port is gone: unplugged, or its other end closed.
    drained   is told that everything of a write() that had to wait was taken.
    """

    def __init__(
        self,
        loop: Loop,
        path: str,
        baud: int,
        received: Callable[[bytes], None],
        broken: Callable[[InterfaceError], None],
        drained: Callable[[], None],
        rtscts: bool = False,
    ) -> None:
        """Open and serve. Raises InterfaceError when it is absent, taken, not permitted or no serial port."""
        self._loop = loop
        self._path = path
        self._received = received
        self._broken = broken
        self._drained = drained
        self._waiting = b""
        try:
            self._port = _opened(path, baud, rtscts)
        except (OSError, ValueError) as error:  # SerialException is an OSError
            kind = BlockedError if getattr(error, "errno", None) in TAKEN else InterfaceError
            raise kind(_why(path, error), _hint(error)) from error
        self._descriptor: int = self._port.fileno()
        self._is_open = True
        loop.add(self)

    @property
    def is_busy(self) -> bool:
        """Whether a part of the last write() still waits for the line."""
        return bool(self._waiting)

    def fileno(self) -> int:
        return self._descriptor

    def ready(self, events: int) -> None:
        if events & WRITE:
            self._go_on()
        # Also after a hang-up: reading says what happened, and gives what came before it.
        if self._is_open and events & ~WRITE:
            self._read()

    def write(self, octets: bytes) -> bool:
        """Write; returns whether all was taken. Otherwise the rest waits and is_busy, or the port has just broken.

        Not while is_busy: what waits is one write, and no more.
        """
        assert not self._waiting
        rest = octets[self._write(octets) :]
        if rest and self._is_open:
            self._waiting = rest
            self._loop.want(self, READ | WRITE)
        return not rest

    def close(self) -> None:
        """Close without waiting for what the line has not sent; idempotent."""
        if self._is_open:
            self._is_open = False
            self._waiting = b""
            self._loop.remove(self)
            _discard(self._descriptor)
            self._port.close()

    def _go_on(self) -> None:
        rest = self._waiting[self._write(self._waiting) :]
        if not self._is_open:
            return
        self._waiting = rest
        if not rest:
            self._loop.want(self, READ)
            self._drained()

    def _write(self, octets: bytes) -> int:
        try:
            return os.write(self._descriptor, octets)
        except BlockingIOError:
            return 0
        except OSError as error:
            self._fail(error.strerror or str(error))
            return 0

    def _read(self) -> None:
        try:
            octets = os.read(self._descriptor, BATCH)
        except BlockingIOError:
            return
        except OSError as error:  # EIO: unplugged, or the other end of a pty closed
            self._fail(error.strerror or str(error))
            return
        if octets:
            self._received(octets)
        else:
            self._fail("hung up")

    def _fail(self, why: str) -> None:
        self.close()
        self._broken(InterfaceError(f"{self._path} is gone: {why.lower()}"))


def _opened(path: str, baud: int, rtscts: bool) -> "Serial":
    """The port by pyserial, which opens with O_NONBLOCK | O_NOCTTY, sets raw mode and locks the port (flock)."""
    import termios

    import serial  # 15 ms that a station without serial ports saves

    class Port(serial.Serial):
        """With DTR and RTS as opening has made them: active (tty_port_block_til_ready of the kernel).

        pyserial would set them once more, and not open a USB device that refuses that, as those may that have none.
        """

        def _update_dtr_state(self) -> None: ...

        def _update_rts_state(self) -> None: ...

    try:
        return Port(path, baud, timeout=0, write_timeout=0, rtscts=rtscts, exclusive=True)
    except termios.error as error:  # which is no OSError: it was unplugged after it was opened, before it was set
        raise OSError(*error.args) from error


def _discard(descriptor: int) -> None:
    """Throw away what the line has not sent: close() would wait for it, up to closing_wait, 30 s by default."""
    import termios  # with pyserial, not before

    # A port that is gone has nothing to throw away.
    with suppress(termios.error):
        termios.tcflush(descriptor, termios.TCOFLUSH)


def _why(path: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{path} is taken by another program"
    return f"{path}: {os.strerror(number).lower() if number else error}"


def _hint(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.EACCES:
        return "the user must be in the group of the device, mostly dialout"
    if number == errno.ENOENT:
        return "is it plugged in? /dev/serial/by-id lists what is"
    return ""
