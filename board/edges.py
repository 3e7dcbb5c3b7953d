"""A GPIO line whose edges the kernel stamps, in the interrupt that they cause."""

import errno
import os
from pathlib import Path
from typing import Any, Literal, NamedTuple

from board.description import LineDescription
from board.errors import InterfaceError
from board.gpiochip import DEV, library, place, request, told

Kind = Literal["rising", "falling"]

# Events that the kernel keeps until they are read; of more, the newest.
BUFFER = 16

NO_INTERRUPT = "the chip has no interrupt for this line: take another line, best one of the Pi itself"


class Edge(NamedTuple):
    """A change of a line's voltage.

    sequence      the kernel's count of this line's edges since it was asked for, from 1; wraps at 2**32.
    monotonic_ns  CLOCK_MONOTONIC of the interrupt. The kernel could stamp by CLOCK_REALTIME as well, since 5.11: that
                  is stepped, and nobody could tell whether it was between the interrupt and the moment of reading.
    """

    sequence: int
    monotonic_ns: int


class EdgeLine:
    """An input of a GPIO chip, ours alone until it is closed; its descriptor is ready when there are edges.

    description  of which chip, offset and line count. Rising and falling are of the voltage.
    """

    def __init__(self, description: LineDescription, kind: Kind = "rising", dev: Path = DEV) -> None:
        """Raises InterfaceError when the line is absent, taken, not permitted or without interrupt."""
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
        """Edges that have come, in their order, so many at most. Raises InterfaceError when the chip is gone."""
        with told(self.where):
            try:
                events: list[Any] = self._request.read_edge_events(most)
            except BlockingIOError:
                return []
        return [Edge(event.line_seqno, event.timestamp_ns) for event in events]

    def check(self) -> None:
        """Raises InterfaceError when the chip is gone: it tells nobody who only waits for edges."""
        with told(self.where):
            self._request.get_value(self._offset)

    def close(self) -> None:
        """Give it back; idempotent."""
        self._request.release()
