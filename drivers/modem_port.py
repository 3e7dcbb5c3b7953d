"""A modem's AT port on the loop: a tty, the AT core, and the timer between them."""

from collections.abc import Callable
from typing import NamedTuple

from board.errors import InterfaceError
from board.loop import Loop, Timer
from board.serial import SerialPort
from drivers.wire.at import Answer, AtCore, Event, Garbage, Unsolicited
from drivers.wire.at_forms import Command

BAUD = 115_200  # a USB port has none; a UART of a SIMCom module begins with this

Done = Callable[[Answer], None]


class Above(NamedTuple):
    """What a port tells.

    unsolicited  a line that nobody asked for.
    garbage      what each read had of it.
    broken       once: it is gone. Unless that closes it, every command that waited is then answered GONE.
    """

    unsolicited: Callable[[str], None]
    garbage: Callable[[Garbage], None]
    broken: Callable[[InterfaceError], None]


class AtPort:
    """Commands in, answers by a call; raises InterfaceError where the tty cannot be opened."""

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
        """Send a command when it is its turn; done is called once, later. Raises RequestError when too many wait."""
        self._done[self.core.command(command, self._loop.clock(), priority)] = done
        self._write()

    def close(self) -> None:
        """Close; idempotent. Nothing is called any more."""
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
            if not self._is_open:  # because of what was told before
                return
            if isinstance(event, Answer):
                self._done.pop(event.number)(event)
            elif isinstance(event, Unsolicited):
                self._above.unsolicited(event.line)
            else:
                self._above.garbage(event)
        self._write()

    def _write(self) -> None:
        """Hand over what the core wants written, as the line takes it, and wait for what the core waits for."""
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
