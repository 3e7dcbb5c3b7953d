"""A loop whose clock jumps, and a machine with a USB hub."""

import pytest

from drivers.sim.machine import SimulatedMachine
from tests.virtual import VirtualLoop


@pytest.fixture
def loop():
    loop = VirtualLoop()
    yield loop
    loop.close()


@pytest.fixture
def machine(tmp_path):
    """A hub at 1-1 with four ports."""
    machine = SimulatedMachine(tmp_path)
    yield machine
    machine.close()
