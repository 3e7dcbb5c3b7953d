"""Serial port on the loop: opened raw and exclusively, never drained."""

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from board.runtime.errors import BlockedError, InterfaceError
from board.runtime.loop import READ, WRITE, Loop

if TYPE_CHECKING:
    from serial import Serial

TAKEN = (errno.EAGAIN, errno.EBUSY, errno.EACCES, errno.EPERM)  # in use by another program, or not permitted

BATCH = 4096  # most octets read in one turn; the queue of a tty holds no more


class SerialPort:
    """Serial port: calls received() with input, and writes output at once or when the line takes it.

    received  called with the octets that arrived, at least one.
    broken    called once when the port is gone: unplugged, or its other end closed.
    drained   called when the line has taken the rest of a write() that had to wait.
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
        """Open the port. Raises InterfaceError if it is absent, in use, not permitted, or not a serial port."""
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
        self.is_open = True
        loop.add(self)

    @property
    def is_busy(self) -> bool:
        """True while a part of the last write() waits for the line."""
        return bool(self._waiting)

    def fileno(self) -> int:
        return self._descriptor

    def ready(self, events: int) -> None:
        if events & WRITE:
            self._go_on()
        # Read also after a hang-up: it returns the octets that came before, then the error.
        if self.is_open and events & ~WRITE:
            self._read()

    def write(self, octets: bytes) -> bool:
        """Write; return True if the line took everything. Else the rest waits and is_busy, or the port has failed.

        Do not call it while is_busy: only one write can wait.
        """
        assert not self._waiting
        rest = octets[self._write(octets) :]
        if rest and self.is_open:
            self._waiting = rest
            self._loop.want(self, READ | WRITE)
        return not rest

    def close(self) -> None:
        """Close at once and discard unsent octets; idempotent."""
        if self.is_open:
            self.is_open = False
            self._waiting = b""
            self._loop.remove(self)
            _discard(self._descriptor)
            self._port.close()

    def _go_on(self) -> None:
        rest = self._waiting[self._write(self._waiting) :]
        if not self.is_open:
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
    """Open the port by pyserial, which sets O_NONBLOCK, O_NOCTTY and raw mode, and locks the port by flock."""
    import termios

    import serial  # takes 15 ms, which stations without serial ports save

    class Port(serial.Serial):
        """Serial port that leaves DTR and RTS active, as the kernel's open has set them (tty_port_block_til_ready).

        pyserial would set them again, and could then not open USB devices that refuse the request.
        """

        def _update_dtr_state(self) -> None: ...

        def _update_rts_state(self) -> None: ...

    try:
        return Port(path, baud, timeout=0, write_timeout=0, rtscts=rtscts, exclusive=True)
    except termios.error as error:  # not an OSError; the port was unplugged between its opening and its set-up
        raise OSError(*error.args) from error


def _discard(descriptor: int) -> None:
    """Discard unsent octets, because close() would wait for them, up to closing_wait, 30 s by default."""
    import termios  # imported late, like pyserial

    # If the port is gone, there is nothing to discard.
    with suppress(termios.error):
        termios.tcflush(descriptor, termios.TCOFLUSH)


def _why(path: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{path} is in use by another program"
    return f"{path}: {os.strerror(number).lower() if number else error}"


def _hint(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.EACCES:
        return "add the user to the group of the device, mostly dialout"
    if number == errno.ENOENT:
        return "check that it is plugged in: /dev/serial/by-id lists ports"
    return ""
