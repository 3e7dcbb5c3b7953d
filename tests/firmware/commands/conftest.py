import socket
from pathlib import Path

import pytest

from firmware.lab import ports
from firmware.user import systemd
from tests.broker.fixtures import brokers, certificates

__all__ = ["brokers", "certificates"]


@pytest.fixture
def block() -> int:
    """The first of twenty ports in a row that nobody has: enough for two stations."""
    while True:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            first: int = probe.getsockname()[1]
        if first < 65_000 and all(ports.is_free("127.0.0.1", port) for port in range(first, first + 20)):
            return first


@pytest.fixture(autouse=True)
def no_service(monkeypatch: pytest.MonkeyPatch) -> None:
    """The station of the machine that the tests run on is not looked at."""
    monkeypatch.setattr(systemd, "MANAGER", Path("/nonexistent"))


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where stations that a command starts have their control sockets: one that is killed leaves its own behind."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("r")))
