"""Pulses on a GPIO line, without the kernel's pps-gpio."""

from collections.abc import Callable
from pathlib import Path

from board.description import LineDescription
from board.edges import Edge, EdgeLine, Kind
from board.gpiochip import DEV, place
from board.runtime.errors import InterfaceError
from board.runtime.loop import READ, Loop, Timer
from pps.pulse import OLDEST_NS, REST_S, STORM_NS, Above, Clocks, Pulse, Tally, read_clocks

# The removal of a chip causes no event. So the chip is checked if no edge has come for this time.
SILENT_S = 2.0


class Edges:
    """Pulses of a GPIO line, reported on the loop; their sequence begins again with each start().

    line  line as in a board file: chip and offset, or name.
    kind  edge of the voltage that begins a second.
    """

    def __init__(
        self,
        loop: Loop,
        line: LineDescription,
        above: Above,
        *,
        kind: Kind = "rising",
        dev: Path = DEV,
        clocks: Callable[[], Clocks] = read_clocks,
    ) -> None:
        self.where = place(line, dev)
        self.tally = Tally(above)
        self._loop = loop
        self._description = line
        self._above = above
        self._kind: Kind = kind
        self._dev = dev
        self._clocks = clocks
        self._line: EdgeLine | None = None
        self._timer: Timer | None = None
        self._newest_ns: int | None = None

    def start(self) -> None:
        """Start reporting pulses; without effect if started. Raises InterfaceError if the line cannot be opened."""
        if self._line is None:
            self._line = EdgeLine(self._description, self._kind, self._dev)
            self._newest_ns = None
            self.tally.begin(0)
            self._listen()

    def stop(self) -> None:
        """Stop reporting, and return at once; idempotent."""
        if self._line is not None:
            self._loop.remove(self)
            self._line.close()
            self._line = None
            self._again(None)
            self.tally.end()

    def fileno(self) -> int:
        return self._line.fileno() if self._line is not None else -1

    def ready(self, events: int) -> None:
        line = self._line
        assert line is not None
        try:
            edges = line.read()
            if events & ~READ:
                line.check()
        except InterfaceError as error:
            self._fail(error)
            return
        if edges:
            self._take(edges)

    def _take(self, edges: list[Edge]) -> None:
        line, now, newest_ns = self._line, self._clocks(), self._newest_ns
        self._newest_ns = edges[-1].monotonic_ns
        for edge in edges:
            ago_ns = round(now.monotonic * 1e9) - edge.monotonic_ns
            if ago_ns <= OLDEST_NS:
                stamp = (now.system_ns - ago_ns, now.raw_ns - ago_ns, edge.monotonic_ns / 1e9)
                self.tally.take(Pulse(edge.sequence, *stamp))
        if line is not self._line:  # a receiver of the pulses has called stop()
            return
        if len(edges) > 1 or (newest_ns is not None and self._newest_ns - newest_ns < STORM_NS):
            self._loop.remove(self)
            self._again(self._loop.after(REST_S, self._listen))
        else:
            self._again(self._loop.after(SILENT_S, self._look))

    def _listen(self) -> None:
        self._loop.add(self)
        self._again(self._loop.after(SILENT_S, self._look))

    def _look(self) -> None:
        assert self._line is not None
        try:
            self._line.check()
        except InterfaceError as error:
            self._fail(error)
        else:
            self._again(self._loop.after(SILENT_S, self._look))

    def _again(self, timer: Timer | None) -> None:
        """Replace the pending timer."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = timer

    def _fail(self, error: InterfaceError) -> None:
        self.stop()
        self._above.failed(error)
