"""Fixtures of the C++ client: built once per session with each compiler, and connected to a double of a station."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.firmware.captain_client.cpp.double import Double
from tests.firmware.captain_client.cpp.driver import PROGRAM, TOOLCHAINS, Driver, Installed, install
from tests.system.conftest import launch_shared

__all__ = ["launch_shared"]  # fixture

# `make test` takes the compiler that it needs anyway. `make portable` takes clang with sanitizers as well.
WANTED = [name for name in TOOLCHAINS if name == "gcc" or "CAPTAIN_PORTABLE" in os.environ]


@pytest.fixture(scope="session", params=WANTED)
def installed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    return install(TOOLCHAINS[request.param], tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="session")
def program(installed: Installed, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the driver, built by CMake."""
    return installed.built(PROGRAM, tmp_path_factory.mktemp("driver")) / "driver"


@pytest.fixture
def driver(program: Path, double: Double) -> Iterator[Driver]:
    """Return a client that is connected to the double."""
    driver = Driver(program, double.address)
    double.welcome()
    assert driver.line() == {"said": "connected"}
    yield driver
    driver.close()
