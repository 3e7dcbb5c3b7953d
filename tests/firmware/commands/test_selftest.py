"""captain selftest: what is asked, and a station that runs for the test alone."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from firmware import cli
from firmware.commands import selftest
from firmware.station.station import Station
from tests.said import tells


@pytest.fixture
def quiet(block: int) -> list[str]:
    """Options of which no station runs."""
    return ["--board", "none", "--set", f"endpoint.from_users={block}"]


def test_a_board_that_declares_nothing_is_told_at_once(quiet: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["selftest", *quiet]) == 1
    assert "nothing is declared" in capsys.readouterr().out


def test_an_interface_that_works_needs_no_ports_of_a_station(
    quiet: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    air = ["--set", "interfaces.air.driver=udp", "--set", "interfaces.air.listen=127.0.0.1:0"]
    assert cli.main(["selftest", "--json", *quiet, *air]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["capability"], row["works"]) == ("interface air", True)


def test_selftest_that_does_not_end_is_ended(
    quiet: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def mute(station: object, answer: Callable[[Any], None]) -> None:
        """It answers nobody."""

    monkeypatch.setattr(Station, "selftest", mute)
    monkeypatch.setattr(selftest, "PATIENCE_S", 0.05)
    assert cli.main(["selftest", *quiet]) == 1
    said = capsys.readouterr().err
    assert tells(said, "no answer", "0.05 s", "captain doctor")
