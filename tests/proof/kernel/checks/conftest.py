"""The checks' side of the bench: what was seen goes to the other side as it is seen, one JSON object a line."""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import pytest

from board.runtime.loop import Loop
from tests.proof.kernel.checks.kernel import Seen

RESULTS = os.environ.get("CAPTAIN_RESULTS", "")  # a serial line; outside of the guest pytest reads this file, too

_seconds: dict[str, float] = {}
_troubles: dict[str, str] = {}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--lab-s", type=float, default=5.0)
    parser.addoption("--skip", type=int, default=0, help="so many checks, which another guest has told of")


@pytest.fixture
def loop() -> Iterator[Loop]:
    with closing(Loop()) as loop:
        yield loop


@pytest.fixture
def seen(record_property: Callable[[str, object], None]) -> Seen:
    """Tells what a check saw; the words of several calls are joined."""
    return lambda words: record_property("seen", words)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    del items[: config.getoption("--skip")]


def pytest_collection_finish(session: pytest.Session) -> None:
    _tell(promised=[_title(item.nodeid) for item in session.items])


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """One row a check, when it is torn down."""
    seconds = _seconds[report.nodeid] = _seconds.get(report.nodeid, 0.0) + report.duration
    if not report.passed:
        _troubles.setdefault(report.nodeid, report.longreprtext or report.outcome)
    if report.when == "teardown":
        words = "; ".join(str(value) for name, value in report.user_properties if name == "seen")
        trouble = _troubles.get(report.nodeid, "")
        _tell(check=_title(report.nodeid), seen=words, seconds=round(seconds, 1), trouble=trouble)


def pytest_sessionfinish(exitstatus: int) -> None:
    _tell(exit=int(exitstatus))


def _title(nodeid: str) -> str:
    """`modem: the kernel binds option` of .../check_modem.py::test_the_kernel_binds_option."""
    file, _, name = nodeid.partition("::")
    return f"{file.rpartition('check_')[2].removesuffix('.py')}: {name.removeprefix('test_').replace('_', ' ')}"


def _tell(**what: Any) -> None:
    if not RESULTS:
        return
    with open(RESULTS, "w") as results:
        results.write(json.dumps(what) + "\n")
