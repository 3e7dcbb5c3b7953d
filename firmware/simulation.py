"""What plays the world for a board file that asks for it: stations in the neighbourhood, and the board's own parts."""

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from board.loop import Loop
from board.machine import REAL, Machine
from drivers.sim.neighbours import Neighbours, with_ports
from firmware.board_file import Board

if TYPE_CHECKING:
    from drivers.sim.board import SimulatedBoard as Playing


class Simulation:
    """Nothing at all, for a board that is real and has no simulated neighbours.

    machine  where the files of the kernel are.
    worker   program that does what blocks.
    """

    def __init__(self, loop: Loop, board: Board) -> None:
        self.machine: Machine = REAL
        self.worker = "board"
        self.board: Playing | None = None
        air = with_ports(board.neighbours) if board.neighbours else None
        self._neighbours = Neighbours(loop, air) if air else None
        if board.simulated:
            from drivers.sim.board import SimulatedBoard

            self.board = SimulatedBoard(loop, board, air)
            self.machine, self.worker = self.board.machine, "sim-board"

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
