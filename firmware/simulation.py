"""What plays the world for a board file that asks for it: stations in the neighbourhood, and the board's own parts."""

import os
import random
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from board.loop import Loop
from board.machine import REAL, Machine
from drivers.sim.neighbours import Neighbours, with_ports
from firmware.board_file import Board

if TYPE_CHECKING:
    from drivers.sim.board import SimulatedBoard as Playing
    from pps.pulse import Above, Clocks, Pulses

# Of interrupts on a Pi 4, ns: as PPS-Client has found them.
LATE_NS, JITTER_NS, LEAST_LATE_NS = 4_400, 600, 2_000
SEED = 6


class Simulation:
    """Nothing at all, for a board that is real and has no simulated neighbours.

    machine   where the files of the kernel are.
    worker    program that does what blocks.
    heard_at  address and port where the station hears simulated stations; empty where there are none.
    """

    def __init__(self, loop: Loop, board: Board) -> None:
        self._loop = loop
        self.machine: Machine = REAL
        self.worker = "board"
        self.board: Playing | None = None
        air = with_ports(board.neighbours) if board.neighbours else None
        self.heard_at = air.to if air else ""
        self._neighbours = Neighbours(loop, air) if air else None
        if board.simulated:
            from drivers.sim.board import SimulatedBoard

            self.board = SimulatedBoard(loop, board, air)
            self.machine, self.worker = self.board.machine, "sim-board"

    def pulses(self, above: "Above", clocks: "Callable[[], Clocks]") -> "Pulses":
        """Those of the simulated receiver, or of the system's clock where there is none, late by seeded chance."""
        from pps.simulated import Simulated

        board, chance = self.board, random.Random(SEED)
        assert board is not None  # who reads board files has seen to it

        def truth(now: "Clocks") -> int:
            return board.receiver.gps_ns(now.monotonic) if board.receiver else now.system_ns

        def late_ns() -> int:
            return max(LEAST_LATE_NS, round(chance.gauss(LATE_NS, JITTER_NS)))

        made = Simulated(self._loop, above, truth=truth, latency_ns=late_ns, clocks=clocks)

        def silence(is_silent: bool) -> None:
            made.is_silent = is_silent

        board.silence = silence
        return made

    @property
    def neighbours_at(self) -> str:
        """Where the neighbours hear, once started; empty where there are none."""
        return self._neighbours.address if self._neighbours else ""

    def played(self, options: Any) -> Any:
        """A driver's options with the simulated library in place of a real one, where they ask for it."""
        if getattr(options, "library", "") != "simulated":
            return options
        from drivers.sim.radio import library_path

        return replace(options, library=str(library_path()))

    def start(self) -> None:
        """Raises InterfaceError when the neighbours' address is taken."""
        if self._neighbours is not None:
            self._neighbours.start()
        if self.board is not None:
            self.board.start()
            os.environ.update(self.board.environment)  # of this process and those that it starts

    def finish(self) -> None:
        """The neighbours fall silent: what they say is not taken any more. Idempotent."""
        if self._neighbours is not None:
            self._neighbours.stop()

    def stop(self) -> None:
        """Idempotent."""
        self.finish()
        if self.board is not None:
            self.board.close()
