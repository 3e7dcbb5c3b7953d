"""A slot that has been started, and one whose driver runs."""

import pytest

from firmware.slots.states import SlotState
from tests.firmware.slots.bench import Bench
from tests.virtual import VirtualLoop


@pytest.fixture
def bench(loop: VirtualLoop) -> Bench:
    bench = Bench(loop)
    bench.slot.start()
    return bench


@pytest.fixture
def running(bench: Bench) -> Bench:
    bench.until(SlotState.RUNNING)
    return bench
