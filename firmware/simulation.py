"""What plays the world for a board file that asks for it: stations in the neighbourhood, and the board's own parts."""

from board.loop import Loop
from board.machine import REAL, Machine
from drivers.sim.neighbours import Neighbours
from firmware.board_file import Board


class Simulation:
    """Nothing at all, for a board that is real and has no simulated neighbours.

    machine  where the files of the kernel are.
    worker   program that does what blocks.
    """

    def __init__(self, loop: Loop, board: Board) -> None:
        self.machine: Machine = REAL
        self.worker = "board"
        self._neighbours = Neighbours(loop, board.neighbours) if board.neighbours else None

    def start(self) -> None:
        """Raises InterfaceError when the neighbours' address is taken."""
        if self._neighbours is not None:
            self._neighbours.start()

    def finish(self) -> None:
        """The neighbours fall silent: what they say is not taken any more. Idempotent."""
        if self._neighbours is not None:
            self._neighbours.stop()

    def stop(self) -> None:
        """Idempotent."""
        self.finish()
