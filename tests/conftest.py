"""Fixtures and settings of all tests: own network, fixed examples, virtual time."""

import gc
import os
import select
import signal
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.configuration import set_hypothesis_home_dir

from tests.network import isolate
from tests.virtual import VirtualLoop

# nohup makes its children ignore SIGHUP, and shells make background processes ignore SIGINT. Restore the defaults, so
# that both signals end the tests and the programs that they start.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)

# Parts of the tests run in parallel, and with other programs. In a network namespace of its own, each may use any port.
try:
    isolate()
    WARNING = ""
except OSError as error:
    WARNING = f"network namespace: {error.strerror}; ports of other programs may clash with those of the tests"

# Tests neither read nor write message types that are registered on this machine.
os.environ["CAPTAIN_TYPES"] = ""

set_hypothesis_home_dir("build/hypothesis")

# derandomize makes every failure reproducible. A deadline would fail tests while the machine is busy with other work.
settings.register_profile(
    "captain",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("captain")


def pytest_collection_finish() -> None:
    """Exclude the collected tests from garbage collection: thousands of them stay until the end."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if WARNING:
        terminalreporter.write_line(WARNING)


@pytest.fixture
def loop() -> Iterator[VirtualLoop]:
    """Return a loop on virtual time. Tests with threads or child processes use a fixture of their own instead."""
    with closing(VirtualLoop()) as loop:
        yield loop


@pytest.fixture(scope="session")
def wait_for_end() -> Callable[[int], None]:
    """Return a function that waits for the end of a process, which need not be a child of the test process."""
    return _wait_for_end


def _wait_for_end(pid: int) -> None:
    try:
        pidfd = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    # Only a failing test reaches the timeout.
    assert select.select([pidfd], [], [], 20.0)[0], f"process {pid} lives on"
    os.close(pidfd)
