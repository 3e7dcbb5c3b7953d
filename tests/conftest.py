"""Fixtures and settings of all tests: an own network, the same examples in every run, a loop whose clock jumps."""

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

# nohup ignores SIGHUP, and a shell SIGINT of what it runs in the background: here as in what is started they end.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)

# Parts of the tests run side by side, and other programs beside them: none takes a port of another.
try:
    isolate()
    WARNING = ""
except OSError as error:
    WARNING = f"network namespace: {error.strerror}; ports of other programs may clash with those of the tests"

set_hypothesis_home_dir("build/hypothesis")

# derandomize: a failure seen once is seen by everybody. No deadline: the machine may be busy with other work.
settings.register_profile(
    "captain",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("captain")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if WARNING:
        terminalreporter.write_line(WARNING)


@pytest.fixture
def loop() -> Iterator[VirtualLoop]:
    """For what is ready at once or waits for a timer; a folder or a file whose ends are elsewhere has its own."""
    with closing(VirtualLoop()) as loop:
        yield loop


@pytest.fixture(scope="session")
def wait_for_end() -> Callable[[int], None]:
    """Waits until a process has ended, of which the test's own need not be the parent."""
    return _wait_for_end


def _wait_for_end(pid: int) -> None:
    try:
        pidfd = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    # The time-out only bounds a failure.
    assert select.select([pidfd], [], [], 20.0)[0], f"process {pid} lives on"
    os.close(pidfd)
