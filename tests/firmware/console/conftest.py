import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from firmware.console import survey, terminal
from firmware.console.addresses import AddressedDevice
from firmware.console.journal import Journal
from tests.firmware.commands.conftest import block
from tests.firmware.console.emulated import Bench
from tests.virtual import VirtualLoop

__all__ = ["block"]

ETH0 = AddressedDevice("eth0", "up", ("192.168.1.20/24", "fe80::1/64"))


@pytest.fixture
def status() -> dict[str, Any]:
    """What a station with the simulated board has said."""
    found: dict[str, Any] = json.loads(Path(__file__).with_name("status.json").read_text())
    return found


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine with one address, that nobody asks for its journal."""
    monkeypatch.setattr(survey, "devices", lambda: [ETH0])
    monkeypatch.setattr(survey, "is_open", lambda port: False)
    monkeypatch.setattr(Journal, "look", lambda journal: None)


@pytest.fixture
def bench(machine: None, tmp_path: Path, status: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """A console on that machine, and a station that is not started yet."""
    with closing(VirtualLoop()) as loop, closing(Bench(loop, tmp_path, status)) as bench:
        monkeypatch.setattr(terminal, "os", bench.terminal.ours)
        yield bench
