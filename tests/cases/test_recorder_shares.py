"""Kept files of a recorder under DENMs that never end: the oldest go, and each station and cause has a share."""

from pathlib import Path

import pytest

from firmware.recorder.ring import Limits
from firmware.recorder.shares import OWN, Key, key_of, operators, word_of
from firmware.recorder.sinks import Keeper
from tests.firmware.recorder.reported_frames import read, told

SIZE = 256 << 10
LIMITS = Limits(size=SIZE, age_s=160.0, before_s=2.0, after_s=1.0)
ATTACKER, VICTIM = 666, 1337


class Bench:
    """A keeper whose clock the test moves."""

    def __init__(self, folder: Path) -> None:
        self.now = 1000.0
        self.folder = folder
        self._number = 0
        self.keeper = Keeper(folder, LIMITS, frozenset({"denm", "loss", "gnss"}), lambda: self.now)
        self.keeper.take_status({})

    def frame(self, kind: str, station: int, **more: object) -> int:
        """Let one come, 0.1 s after the last; returns its number."""
        self._number += 1
        self.keeper.add(told(self._number, frame=bytes(1000), type=kind, station_id=station, **more))
        self.wait(0.1)
        return self._number

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.keeper.idle()

    def event(self, station: int, **more: object) -> int:
        """A DENM, with CAMs around it, and the end of its event; returns its number."""
        for _ in range(10):
            self.frame("cam", 1)
        number = self.frame("denm", station, **more)
        for _ in range(10):
            self.frame("cam", 1)
        self.wait(LIMITS.after_s + 60.0)
        return number

    def kept(self) -> list[object]:
        return [frame.said["sequence"] for path in sorted(self.folder.glob("kept-*")) for frame in read(path)]

    def status(self) -> dict[str, object]:
        return self.keeper.ring.status()


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_the_denm_of_an_accident_is_kept_after_a_thousand_others(bench: Bench) -> None:
    for number in range(200):
        bench.event(ATTACKER + number)
    accident = bench.event(VICTIM)
    assert accident in bench.kept()
    status = bench.status()
    assert (status["kept"], status["not_kept"]) == (201, 0)
    assert status["kept_octets"] == sum(path.stat().st_size for path in bench.folder.glob("kept-*"))
    assert SIZE // 2 < int(str(status["kept_octets"])) <= SIZE


def test_a_station_that_sends_denms_for_ever_removes_only_its_own(bench: Bench) -> None:
    accident = bench.event(VICTIM)
    last = [bench.event(ATTACKER) for _ in range(100)][-1]
    assert {accident, last} <= set(bench.kept())


def test_denms_of_made_up_stations_remove_no_other_cause_and_no_own_denm(bench: Bench) -> None:
    own = bench.event(VICTIM, direction="out")
    near_miss = bench.frame("cam", 2)
    bench.keeper.trigger("near miss")
    bench.wait(70.0)
    bench.keeper.time({"state": "locked"})
    lost_time = bench.frame("cam", 3)
    bench.keeper.time({"state": "holdover"})
    bench.wait(70.0)
    for number in range(200):
        bench.event(ATTACKER + number)
    assert {own, near_miss, lost_time} <= set(bench.kept())


def test_a_denm_in_the_event_of_another_station_counts_for_its_own(bench: Bench) -> None:
    for _ in range(20):
        bench.event(ATTACKER)
    bench.frame("denm", ATTACKER)
    for _ in range(12):
        bench.frame("cam", 1)
        bench.wait(0.1)
    accident = bench.frame("denm", VICTIM)
    bench.wait(70.0)
    for _ in range(50):
        bench.event(ATTACKER)
    assert accident in bench.kept()
    assert any(path.name.endswith(f"-denm-{VICTIM}.pcapng") for path in bench.folder.glob("kept-*"))


def test_denms_of_many_stations_in_a_moment_are_one_event_and_few_files(bench: Bench) -> None:
    for number in range(500):
        bench.keeper.add(told(number + 1, type="denm", station_id=number))
    bench.wait(70.0)
    assert bench.status()["kept"] == 1
    assert len(list(bench.folder.glob("kept-*"))) <= 16


def test_shares_are_known_by_the_next_run(tmp_path: Path) -> None:
    first = Bench(tmp_path)
    accident = first.event(VICTIM)
    first.keeper.close()
    second = Bench(tmp_path)
    second._number = 10_000
    for _ in range(100):
        second.event(ATTACKER)
    assert accident in second.kept()


@pytest.mark.parametrize(
    ("word", "key"),
    [
        ("denm-1337", Key("denm", "1337")),
        (f"denm-{OWN}", Key(OWN)),
        ("denm", Key("denm")),
        ("loss", Key("loss")),
        ("gnss", Key("gnss")),
        ("near-miss", Key("operator")),
        ("denm-loss", Key("operator")),
    ],
)
def test_a_kept_file_counts_in_the_share_that_its_name_says(word: str, key: Key) -> None:
    assert key_of(word) == key


@pytest.mark.parametrize("why", ["denm", "denm 1337", "loss", "denm-own", "GNSS", "denm/7", "near miss", "é" * 300, ""])
def test_an_operator_s_reason_passes_for_no_other_cause(why: str) -> None:
    assert key_of(word_of(operators(why))) == Key("operator")
