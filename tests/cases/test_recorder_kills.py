"""Counts of a recorder whose process is killed: each frame is recorded or lost, and in one count."""

import os
import random
import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from firmware.recorder.recovery import RecorderCounts, restore, state_of
from firmware.recorder.ring import Limits
from firmware.recorder.sinks import Keeper
from tests.firmware.recorder.reported_frames import read, told
from tests.system.conftest import Bench, Launcher
from tests.system.user import mark

LIMITS = Limits(size=256 << 10, age_s=1000.0, before_s=2.0, after_s=1.0)
FRAMES = 6_000


@pytest.fixture
def launch(tmp_path: Path) -> Iterator[Launcher]:
    launcher = Launcher(lambda: tmp_path)
    yield launcher
    launcher.close()


def test_frames_are_in_one_count_whatever_is_killed(launch: Launcher, tmp_path: Path) -> None:
    ring = tmp_path / "ring"
    table = {"folder": str(ring), "in_memory": True, "size_mb": 64}
    bench = launch("pdu", recorder=table, reception={"duplicate_window_s": 0.0})
    status = bench.station.until(lambda status: bool(status["recorder"].get("file")))
    before = given(status) - in_counts(status)  # while it started
    # Kills with frames that wait and that come meanwhile, one in a silence, one that nothing follows.
    for part in range(4):
        for _ in range(FRAMES // 4 if part != 2 else 0):
            bench.air.send(mark())
        recorded = bench.station.status()["recorder"]["frames"]
        if part % 2:
            until_more_is_recorded(bench, recorded)
        why = bench.station.until(lambda status: status["recorder"]["is_running"])["recorder"]["why"]
        os.kill(int(why.split()[1]), signal.SIGKILL)
        for _ in range(100 if part < 3 else 0):
            bench.air.send(mark())
        bench.station.until(lambda status, part=part: status["recorder"]["restarts"] > part)
    status = bench.station.until(lambda status: in_counts(status) >= given(status) - before)
    recorder = status["recorder"]
    assert in_counts(status) == given(status) - before >= FRAMES // 2
    assert recorder["frames"] == sum(len(read(path)) for path in ring.glob("*.pcapng")) > 0
    assert recorder["lost"] == sum(recorder["lost_by"].values())
    assert recorder["lost_by"]["restart"] > 0


def in_counts(status: dict[str, Any]) -> int:
    frames: int = status["recorder"]["frames"] + status["recorder"]["lost"]
    return frames


def given(status: dict[str, Any]) -> int:
    """Frames that came, by the counters of the interface."""
    dropped = sum(row["count"] for row in status["drops"] if row["where"] == "g5")
    return dropped + sum(status["interfaces"]["g5"]["received"].values())


def until_more_is_recorded(bench: Bench, recorded: int) -> None:
    def is_more(status: dict[str, Any]) -> bool:
        bench.air.send(mark())
        return bool(status["recorder"]["frames"] > recorded)

    bench.station.until(is_more)


class Run:
    """Processes one after the other that record one station; each may be killed in the middle of its work."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder = folder
        self.random = random.Random(seed)
        self.now = 1000.0
        self.total = {"air": 0, "wire": 0}
        self._sequence = {"air": 0, "wire": 0}
        self.states: list[RecorderCounts] = []
        self.keeper: Keeper
        (folder / "ring-00000007-20200101T000000Z.pcapng").write_bytes(b"")  # of an earlier station
        self._start()

    def _start(self) -> None:
        keeper = Keeper(self.folder, LIMITS, frozenset(), lambda: self.now)
        if self.states:
            restore(keeper.ring, self.states[-1]._asdict())
        self.keeper = keeper
        keeper.ring.listener = SimpleNamespace(file_closed=self._tell)
        keeper.take_status({"report": {"frames": dict(self.total)}})
        keeper.idle()

    def frame(self, is_heard: bool = True) -> None:
        """One of an interface; some before it may be missed."""
        name = self.random.choice(["air", "wire"])
        missed = self.random.choice([0, 0, 0, 0, 3])
        self._sequence[name] += 1
        self.total[name] += 1 + missed
        if is_heard:
            octets = bytes(self.random.randrange(50, 1400))
            more = {"missed": missed, "total": self.total[name]}
            self.keeper.add(told(self._sequence[name], name, octets, **more))

    def turn(self) -> None:
        self.now += self.random.choice([0.0, 0.1, 0.3])
        self.keeper.idle()
        if self.random.random() < 0.2:
            self._tell()

    def _tell(self) -> None:
        state = state_of(self.keeper.ring)
        self.states += [state] if state else []

    def kill(self) -> None:
        """What was not written is gone, perhaps in the middle of a block; then frames come that nobody hears."""
        filing = self.keeper.ring.filing
        assert filing._segment is not None
        written = bytes(filing._segment._waiting)
        if self.random.random() < 0.5:
            os.write(filing._segment._descriptor, written[: self.random.randrange(len(written) + 1)])
        os.close(filing._segment._descriptor)
        self.keeper.ring._let_go()
        for _ in range(self.random.choice([0, 0, 5])):
            self.frame(is_heard=False)
        self._start()

    def recorded(self) -> int:
        return sum(len(read(path)) for path in self.folder.glob("*.pcapng"))


@pytest.mark.parametrize("seed", range(20))
def test_a_frame_is_recorded_or_lost_at_any_moment_of_a_kill(tmp_path: Path, seed: int) -> None:
    run = Run(tmp_path, seed)
    for _ in range(6):
        for _ in range(run.random.randrange(1, 40)):
            for _ in range(run.random.randrange(3)):
                run.frame()
            run.turn()
        run.kill()
        scribe = run.keeper.scribe
        assert scribe.frames + scribe.lost == sum(run.total.values())
    run.keeper.close()
    scribe = run.keeper.scribe
    assert scribe.frames + scribe.lost == sum(run.total.values())
    assert scribe.frames == run.recorded()
    status = run.keeper.ring.status()
    assert sum(status["lost_by"].values()) == status["lost"]  # type: ignore[attr-defined]


def test_a_file_that_the_ring_removed_before_a_kill_was_recorded(tmp_path: Path) -> None:
    run = Run(tmp_path, 1)
    for _ in range(2000):
        run.frame()
    assert len(run.states) > 16
    lost = run.keeper.scribe.lost
    run.kill()
    scribe = run.keeper.scribe
    assert scribe.frames + scribe.lost == sum(run.total.values())
    assert scribe.frames > 1900
    assert scribe.lost - lost == scribe.killed < 100
