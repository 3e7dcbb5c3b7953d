"""AT port of a modem: a tty on the loop, the AT protocol core, and its timer."""

from collections.abc import Callable
from typing import NamedTuple

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop, Timer
from board.serial import SerialPort
from drivers.wire.at.forms import Command
from drivers.wire.at.port import Answer, AtCore, Event, Garbage, Unsolicited

BAUD = 115_200  # ignored by a USB port; the initial baud rate of a SIMCom module's UART

Done = Callable[[Answer], None]


class Above(NamedTuple):
    """Callbacks of a port.

    unsolicited  called with each unsolicited line.
    garbage      called with the garbage of each read.
    broken       called once, when the port is gone. If the callback does not close the port, each waiting command then
                 gets the answer GONE.
    """

    unsolicited: Callable[[str], None]
    garbage: Callable[[Garbage], None]
    broken: Callable[[InterfaceError], None]


class AtPort:
    """Sends AT commands, and passes each answer to a callback. Raises InterfaceError if the tty cannot be opened."""

    def __init__(self, loop: Loop, path: str, above: Above) -> None:
        self.path = path
        self.core = AtCore()
        self._loop = loop
        self._above = above
        self._done: dict[int, Done] = {}
        self._timer: Timer | None = None
        self._unwritten = b""
        self._is_open = True
        self._port = SerialPort(loop, path, BAUD, self._received, self._broken, self._write)

    def ask(self, command: Command, done: Done, priority: int = 1) -> None:
        """Queue a command; priority 0 leaves first. Call done() later, with its answer.

        Raises RequestError if too many wait.
        """
        self._done[self.core.command(command, self._loop.clock(), priority)] = done
        self._write()

    def close(self) -> None:
        """Close the port; idempotent. No callback is called afterwards."""
        self._is_open = False
        self._done.clear()
        if self._timer is not None:
            self._timer.cancel()
        self._port.close()

    def _received(self, octets: bytes) -> None:
        self._tell(self.core.receive(octets, self._loop.clock()))

    def _expired(self) -> None:
        self._timer = None
        self._tell(self.core.expire(self._loop.clock()))

    def _broken(self, error: InterfaceError) -> None:
        self._above.broken(error)
        self._tell(self.core.reset())
        self.close()

    def _tell(self, events: list[Event]) -> None:
        for event in events:
            if not self._is_open:  # a callback of an earlier event has closed the port
                return
            if isinstance(event, Answer):
                self._done.pop(event.number)(event)
            elif isinstance(event, Unsolicited):
                self._above.unsolicited(event.line)
            else:
                self._above.garbage(event)
        self._write()

    def _write(self) -> None:
        """Write the core's octets as far as the line accepts them, and set the timer to the core's next deadline."""
        if not self._is_open:
            return
        self._unwritten += self.core.take()
        if self._unwritten and not self._port.is_busy:
            octets, self._unwritten = self._unwritten, b""
            self._port.write(octets)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        deadline = self.core.deadline()
        if deadline is not None and self._is_open:
            self._timer = self._loop.after(max(0.0, deadline - self._loop.clock()), self._expired)
