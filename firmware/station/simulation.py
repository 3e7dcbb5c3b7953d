"""Simulation of a board: neighbours, receiver, pulses and chips."""

import os
import random
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from board.machine import REAL, Machine
from board.runtime.loop import Loop
from firmware.config.board_file import Board

if TYPE_CHECKING:
    from drivers.sim.board import SimulatedBoard
    from drivers.sim.neighbours import Neighbours
    from pps.pulse import Above, Clocks, Pulses

# Interrupt latency of a pulse on a Pi 4 in ns, as measured by PPS-Client: mean, standard deviation, minimum.
LATE_NS, JITTER_NS, LEAST_LATE_NS = 4_400, 600, 2_000
SEED = 6


class Simulation:
    """Simulated parts of a board. For a real board without simulated neighbours it does nothing.

    machine   roots of the kernel's files, real or simulated.
    worker    name of the child process for blocking calls.
    heard_at  address and port at which the station receives simulated stations; empty without such stations.
    """

    def __init__(self, loop: Loop, board: Board) -> None:
        self._loop = loop
        self.machine: Machine = REAL
        self.worker = "board"
        self.board: SimulatedBoard | None = None
        self.heard_at = ""
        self._neighbours: Neighbours | None = None
        air = None
        if board.neighbours:
            from drivers.sim import neighbours

            air = neighbours.with_ports(board.neighbours)
            self.heard_at = air.to
            self._neighbours = neighbours.Neighbours(loop, air)
        if board.simulated:
            from drivers.sim import board as simulated

            self.board = simulated.SimulatedBoard(loop, board, air)
            self.machine, self.worker = self.board.machine, "sim-board"

    def pulses(self, above: "Above", clocks: "Callable[[], Clocks]") -> "Pulses":
        """Return simulated pulses with a random latency from a fixed seed.

        They mark the seconds of the simulated receiver, or of the system clock if the board has no simulated receiver.
        """
        from pps.simulated import Simulated

        board, chance = self.board, random.Random(SEED)
        assert board is not None  # the check of the board file permits simulated pulses only on a simulated board

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
        """Address at which the simulated neighbours receive; empty without neighbours."""
        return self._neighbours.address if self._neighbours else ""

    def played(self, options: Any) -> Any:
        """Return a driver's options; the path of the simulated vendor library replaces `library = "simulated"`."""
        if getattr(options, "library", "") != "simulated":
            return options
        from drivers.sim.radio.control import library_path

        return replace(options, library=str(library_path()))

    def start(self) -> None:
        """Start the simulation. Raises InterfaceError if the neighbours' address is in use."""
        if self._neighbours is not None:
            self._neighbours.start()
        if self.board is not None:
            self.board.start()
            os.environ.update(self.board.environment)  # the variables apply to this process and its later children

    def finish(self) -> None:
        """Stop the simulated neighbours, so that no more of their messages arrive; a second call has no effect."""
        if self._neighbours is not None:
            self._neighbours.stop()

    def stop(self) -> None:
        """Stop the whole simulation; a second call has no effect."""
        self.finish()
        if self.board is not None:
            self.board.close()
