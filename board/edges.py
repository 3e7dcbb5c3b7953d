"""GPIO input line with edges stamped by the kernel's interrupt."""

import errno
import os
from pathlib import Path
from typing import Any, Literal, NamedTuple

from board.description import LineDescription
from board.gpiochip import DEV, library, place, request, told
from board.runtime.errors import InterfaceError

Kind = Literal["rising", "falling"]

# Number of events that the kernel keeps until they are read. If there are more, it keeps the newest.
BUFFER = 16

NO_INTERRUPT = "the chip has no interrupt for this line: take another line, best one of the Pi itself"


class Edge(NamedTuple):
    """A change of a line's voltage.

    sequence      the kernel's number of this edge on its line, from 1 after the request; wraps at 2**32.
    monotonic_ns  CLOCK_MONOTONIC at the interrupt. Since 5.11, the kernel could also stamp by CLOCK_REALTIME. That
                  clock is stepped, and a step between interrupt and read could not be detected.
    """

    sequence: int
    monotonic_ns: int


class EdgeLine:
    """Exclusive input line of a GPIO chip, until it is closed. Its descriptor is readable when edges are waiting.

    description  only chip, offset and line are used. Rising and falling refer to the voltage.
    """

    def __init__(self, description: LineDescription, kind: Kind = "rising", dev: Path = DEV) -> None:
        """Request the line. Raises InterfaceError if it is absent, in use, not permitted or without interrupt."""
        gpiod = library()
        self.where = place(description, dev)
        settings = gpiod.LineSettings(
            direction=gpiod.line.Direction.INPUT,
            edge_detection=gpiod.line.Edge.RISING if kind == "rising" else gpiod.line.Edge.FALLING,
            event_clock=gpiod.line.Clock.MONOTONIC,
        )
        try:
            self._request, self._offset = request(description, dev, settings, event_buffer_size=BUFFER)
        except InterfaceError as error:
            cause = error.__cause__
            if isinstance(cause, OSError) and cause.errno in {errno.ENODEV, errno.ENXIO}:
                raise InterfaceError(error.message, NO_INTERRUPT) from cause
            raise
        os.set_blocking(self._request.fd, False)

    def fileno(self) -> int:
        return int(self._request.fd)

    def read(self, most: int = BUFFER) -> list[Edge]:
        """Return at most `most` waiting edges in order of time. Raises InterfaceError if the GPIO chip is gone."""
        with told(self.where):
            try:
                events: list[Any] = self._request.read_edge_events(most)
            except BlockingIOError:
                return []
        return [Edge(event.line_seqno, event.timestamp_ns) for event in events]

    def check(self) -> None:
        """Check for the chip. Raises InterfaceError if it is gone; a wait for edges would not notice that."""
        with told(self.where):
            self._request.get_value(self._offset)

    def close(self) -> None:
        """Release the line; idempotent."""
        self._request.release()
