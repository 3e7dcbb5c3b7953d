"""A machine with a USB hub."""

import pytest

from drivers.sim.machine import SimulatedMachine


@pytest.fixture
def machine(tmp_path):
    """A hub at 1-1 with four ports."""
    machine = SimulatedMachine(tmp_path)
    yield machine
    machine.close()
