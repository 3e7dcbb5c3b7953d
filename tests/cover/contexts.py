"""A plugin of pytest: coverage notes which test has executed a line. -p contexts"""

from collections.abc import Iterator

import coverage
import pytest


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """What a test and its fixtures execute counts for all tests of its function."""
    measuring = coverage.Coverage.current()
    assert measuring is not None, "runs by `coverage run` alone"
    measuring.switch_context(item.nodeid.partition("[")[0])
    yield
    measuring.switch_context("")
