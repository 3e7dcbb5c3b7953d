"""Running station with the far end of its interface, and a double of a station."""

from collections.abc import Iterator

import pytest

from tests.firmware.captain_client.cpp.double import Double
from tests.system.conftest import launch, launch_shared
from tests.system.ports import Ports

__all__ = ["launch", "launch_shared"]  # fixtures


@pytest.fixture
def double() -> Iterator[Double]:
    ports = Ports()
    double = Double(ports)
    yield double
    double.stop()
    ports.release()
