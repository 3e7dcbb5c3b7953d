import random
from pathlib import Path

import pytest

from board.runtime.free_udp import choice
from firmware import systemd
from tests.broker.fixtures import brokers, certificates
from tests.system.ports import is_free

__all__ = ["brokers", "certificates"]


@pytest.fixture
def block() -> int:
    """The first of twenty ports in a row that nobody has: enough for two stations."""
    while True:
        first = random.choice(choice()[:-20])
        if all(is_free(port) for port in range(first, first + 20)):
            return first


@pytest.fixture(autouse=True)
def no_service(monkeypatch: pytest.MonkeyPatch) -> None:
    """The station of the machine that the tests run on is not looked at."""
    monkeypatch.setattr(systemd, "MANAGER", Path("/nonexistent"))


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where stations that a command starts have their control sockets: one that is killed leaves its own behind."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("r")))
