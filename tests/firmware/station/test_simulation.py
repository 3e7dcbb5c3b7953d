"""Simulation: several simulated worlds beside each other."""

from contextlib import ExitStack, closing
from dataclasses import replace

import pytest

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from drivers.sim.options import NeighboursOptions
from drivers.sim.radio.control import VARIABLE
from firmware.config import board_file
from firmware.config.board_file import Board
from firmware.station.simulation import Simulation
from tests.virtual import VirtualLoop


def started(loop: Loop, stack: ExitStack, board: Board) -> Simulation:
    simulation = Simulation(loop, board)
    stack.callback(simulation.stop)
    simulation.start()
    return simulation


def test_two_simulated_boards_run_beside_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "")  # what the first gives its processes is not for the second
    board = board_file.load("sim")
    with closing(VirtualLoop()) as loop, ExitStack() as stack:
        first, second = (started(loop, stack, board) for _ in range(2))
        assert first.board is not None
        assert second.board is not None
        assert first.machine.sys != second.machine.sys


def test_a_port_that_is_given_and_taken_is_an_error_with_what_to_do() -> None:
    board = replace(board_file.load("none"), neighbours=NeighboursOptions("127.0.0.1:0", "127.0.0.1:0"))
    with closing(VirtualLoop()) as loop, ExitStack() as stack:
        taken = started(loop, stack, board).neighbours_at
        again = NeighboursOptions(listen=taken)
        with pytest.raises(InterfaceError, match=taken) as raised:
            started(loop, stack, replace(board, neighbours=again))
        assert "neighbours.listen" in raised.value.hint
