"""A whole station on the simulated board, in virtual time: it comes to know the time, and says so everywhere."""

import json
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from board.time.scales import Lock
from drivers.message import Indication
from tests.proof.chaos.stage import Stage

LOCKED_S = 60.0  # at most: a receiver boots and sees satellites, four seconds agree, and eight make an estimate


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("stage")
    with pytest.MonkeyPatch.context() as patch, closing(Stage(folder, patch, seed=1)) as stage:
        stage.start()
        stage.loop.run_until(lambda: stage.station.timekeeper.quality.state is Lock.LOCKED, LOCKED_S)
        yield stage


def clock(stage: Stage) -> dict[str, Any]:
    """Of the status, as JSON has it."""
    told: dict[str, Any] = json.loads(json.dumps(stage.station.status()))["clock"]
    return told


def test_it_is_locked_and_the_status_says_so(stage: Stage) -> None:
    told = clock(stage)
    assert (told["state"], told["receiver"], told["missing"]) == ("locked", "gnss", "")
    assert told["uncertainty_ns"] < 1_000_000


def test_the_journal_has_each_state_once(stage: Stage) -> None:
    lines = [line for line in stage.journal.lines if "captain.time" in line and "before)" in line]
    words = ("messages", "pulses arrive", "comes from the receiver's pulses")
    assert [next(word for word in words if word in line) for line in lines] == list(words)


class Observer(list[Indication]):
    """Keeps what it is shown."""

    observe = list.extend


def test_indications_have_the_quality_of_their_second(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    heard = Observer()
    monkeypatch.setattr(stage.station.router, "_observers", [heard])
    beside: Any = stage.station.router.interfaces["beside"]
    beside.indicate(bytes.fromhex("020200000539") + b"cam", 1_795_182_426_461_613_000)
    stage.station.router.flush()
    assert [one.quality for one in heard] == [stage.station.timekeeper.quality]
    assert heard[0].quality.state is Lock.LOCKED


def test_its_time_is_estimated_and_that_of_the_receiver(stage: Stage) -> None:
    own_position = stage.station.own_position
    its_ms = own_position.time.estimator.its_ms(stage.loop.now)
    assert its_ms is not None
    assert its_ms == own_position.time.its_ms(stage.loop.now)
    assert its_ms // 1000 in range(clock(stage)["its_ms"] // 1000 - 1, clock(stage)["its_ms"] // 1000 + 2)
    assert stage.station.own_position.ego().its_ms in range(its_ms - 1200, its_ms + 1)


def test_the_control_socket_has_clock_and_history(stage: Stage) -> None:
    told = stage.station.timekeeper.told({"do": "time", "history": True})
    assert set(told) == {"clock", "history"}
    assert len(json.dumps(told)) < 1 << 20  # as much as a command reads


def test_the_self_test_has_pulses_and_time(stage: Stage) -> None:
    answers: list[Any] = []
    stage.station.selftest(answers.append)
    stage.loop.run_until(lambda: bool(answers), 60.0)
    rows = {row["capability"]: row for row in answers[0]["rows"]}
    assert (rows["pulses"]["works"], rows["time"]["works"]) == (True, True)
    assert rows["time"]["value"].startswith("locked, within ")
