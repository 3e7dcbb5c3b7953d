"""A ring of files: its bounds, what is kept, and what a disk in trouble costs."""

import io
import os
from pathlib import Path

import pytest

from firmware.recorder import filing as filing_
from firmware.recorder import ring as ring_
from firmware.recorder.filing import Filing, Segment
from firmware.recorder.ring import PARTS, Limits, Ring, mend
from firmware.recorder.scribe import Scribe
from firmware.recordings.pcapng import Pcapng
from tests.firmware.recorder.reported_frames import read, told
from tests.said import tells

SMALL = Limits(size=64 << 10, age_s=160.0, before_s=20.0, after_s=10.0)


class Bench:
    """A ring whose clock the test moves."""

    def __init__(self, folder: Path, limits: Limits = SMALL) -> None:
        self.now = 1000.0
        self.number = 0
        self.folder = folder
        self.ring = Ring(folder, limits, Scribe(), lambda: self.now)
        self.ring.idle()

    def record(self, count: int, step_s: float = 0.0) -> None:
        for _ in range(count):
            self.number += 1
            self.ring.add(told(self.number))
            if step_s:
                self.wait(step_s)

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.ring.idle()

    def names(self, kind: str = "") -> list[str]:
        return sorted(path.name for path in self.folder.glob(f"{kind}*.pcapng"))

    def sequences(self, kind: str = "") -> list[object]:
        return [frame.said["sequence"] for name in self.names(kind) for frame in read(self.folder / name)]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_what_is_recorded_is_in_its_files_in_order(bench):
    bench.record(100, 0.01)
    bench.ring.close()
    assert len(bench.names()) > 3
    assert bench.sequences("ring-") == list(range(1, 101))
    assert bench.ring.status()["lost"] == 0


def test_the_ring_has_its_size_and_the_newest(bench):
    bench.record(3000, 0.01)
    bench.ring.close()
    assert sum(path.stat().st_size for path in bench.folder.iterdir()) <= SMALL.size + SMALL.size // PARTS
    found = bench.sequences()
    assert found == list(range(3001 - len(found), 3001))
    assert len(found) > 50


def test_the_ring_has_its_age(bench):
    for _ in range(60):
        bench.record(1, 10.0)
    bench.ring.close()
    found = bench.sequences()
    assert found[-1] == 60
    assert 14 <= len(found) <= 20


def test_a_trigger_keeps_what_was_and_what_comes(bench):
    bench.record(10, 10.0)
    bench.ring.trigger("denm")
    bench.record(10, 1.0)
    bench.wait(1.0)
    kept = bench.sequences("kept-")
    assert {9, 10, *range(11, 20)} <= set(kept)
    assert 1 not in kept
    assert all(name.endswith("-denm.pcapng") for name in bench.names("kept-"))
    assert bench.ring.status()["kept"] == 1


def test_what_is_kept_stays_when_the_ring_turns(bench):
    bench.record(20, 1.0)
    bench.ring.trigger("denm")
    bench.wait(11.0)
    kept = bench.sequences("kept-")
    bench.record(3000, 0.01)
    bench.ring.close()
    assert bench.sequences("kept-") == kept != []


def test_a_trigger_while_one_is_kept_makes_it_longer(bench):
    bench.record(1, 1.0)
    bench.ring.trigger("denm")
    bench.record(9, 1.0)
    bench.ring.trigger("loss")
    bench.record(9, 1.0)
    bench.wait(2.0)
    assert bench.ring.status()["kept"] == 1
    assert set(range(1, 20)) <= set(bench.sequences("kept-"))


def test_an_event_ends_though_triggers_never_do(bench):
    bench.record(20, 1.0)
    for _ in range(300):
        bench.ring.trigger("denm")
        bench.record(1, 1.0)
    status = bench.ring.status()
    assert 4 <= status["kept"] + status["not_kept"] <= 6
    kept = bench.sequences("kept-")
    assert kept == list(range(kept[0], kept[0] + len(kept)))


def test_what_was_before_is_kept_at_once(bench):
    bench.record(200, 0.1)
    bench.ring.trigger("denm")
    assert len(bench.names("kept-")) > 1


def test_room_that_an_operator_makes_is_used(bench):
    for _ in range(40):
        bench.record(60, 0.1)
        bench.ring.trigger("denm")
        bench.wait(11.0)
    before = bench.ring.status()["kept_removed"]
    for path in bench.folder.glob("kept-*"):
        path.unlink()
    bench.record(20, 0.1)
    bench.ring.trigger("denm")
    bench.wait(11.0)
    assert bench.names("kept-")
    assert bench.ring.status()["kept_removed"] == before > 0


def test_an_end_keeps_what_was_to_be_kept(bench):
    bench.record(5, 1.0)
    bench.ring.trigger("near miss / Ingolstadt, 9 o'clock")
    bench.ring.close()
    (name,) = {name.partition("Z-")[2] for name in bench.names("kept-")}
    assert name == "near-miss-Ingolstadt-9-o-clock.pcapng"
    assert bench.sequences("kept-")[-1] == 5


def test_of_what_is_kept_the_oldest_goes_where_its_room_is_used_up(bench):
    for _ in range(40):
        bench.record(60, 0.1)
        bench.ring.trigger("denm")
        bench.wait(11.0)
    status = bench.ring.status()
    assert (status["kept"], status["not_kept"]) == (40, 0)
    size = sum(path.stat().st_size for path in bench.folder.glob("kept-*"))
    assert SMALL.size // 2 < size == status["kept_octets"] <= SMALL.size
    assert bench.sequences("kept-")[-1] == 40 * 60


def test_event_larger_than_its_share_is_kept_around_its_trigger(bench, capsys):
    bench.record(2000, 0.01)
    bench.ring.trigger("denm")
    bench.record(2000, 0.005)
    bench.wait(1.0)
    status = bench.ring.status()
    assert (status["kept"], status["not_kept"], status["kept_removed"]) == (0, 1, 0)
    kept = bench.sequences("kept-")
    assert 2000 in kept
    assert kept == list(range(kept[0], kept[-1] + 1))
    assert status["kept_octets"] <= SMALL.size
    assert tells(capsys.readouterr().err, "denm: ", "not completely kept", "65536 octets")


def test_a_second_run_goes_on_with_the_ring_of_the_first(tmp_path):
    first = Bench(tmp_path)
    first.record(100, 0.01)
    first.ring.close()
    second = Bench(tmp_path)
    second.number = 100
    second.record(3000, 0.01)
    second.ring.close()
    found = second.sequences()
    assert found == list(range(3101 - len(found), 3101))
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= SMALL.size + SMALL.size // PARTS


def test_files_of_others_are_left_alone(tmp_path):
    (tmp_path / "ring-notes.pcapng").write_text("mine")
    bench = Bench(tmp_path)
    bench.record(3000, 0.01)
    assert (tmp_path / "ring-notes.pcapng").read_text() == "mine"


def test_a_recording_that_the_power_cut_off_is_mended_by_the_next_run(tmp_path):
    first = Bench(tmp_path)
    first.record(5, 0.01)
    first.wait(1.0)
    first.ring._let_go()
    (path,) = tmp_path.iterdir()
    with path.open("ab") as file:
        file.write(b"\6\0\0\0\x40\0\0\0half a block")
    second = Bench(tmp_path)
    second.ring.close()
    assert [frame.said["sequence"] for frame in read(path)] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("octets", [b"GIF89a..", bytes(100), b"x"])
def test_mending_does_not_touch_what_is_no_recording(tmp_path, octets):
    (tmp_path / "a").write_bytes(octets)
    mend(tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == octets


def test_each_cut_of_a_recording_is_mended_to_whole_blocks(tmp_path):
    stream = io.BytesIO()
    recording = Pcapng(stream, "captain 1")
    for number in range(3):
        recording.add("air", number, bytes(20), comment="x" * number)
    whole = stream.getvalue()
    for size in range(len(whole)):
        (tmp_path / "a").write_bytes(whole[:size])
        mend(tmp_path / "a")
        if (tmp_path / "a").exists():
            assert whole.startswith((tmp_path / "a").read_bytes())
            read(tmp_path / "a")
        else:
            assert size < 60


# -- a disk in trouble


class Disk:
    """os.write, os.fdatasync as a disk that is full or worn out has them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.error = 0
        self.takes = 0  # octets of a write that is then refused
        self._write, self._sync = os.write, os.fdatasync
        monkeypatch.setattr(filing_.os, "write", self.write)
        monkeypatch.setattr(filing_.os, "fdatasync", self.sync)

    def write(self, descriptor: int, octets: bytes) -> int:
        if self.error and self.takes:
            taken, self.takes = self.takes, 0
            return self._write(descriptor, octets[:taken])
        self.check()
        return self._write(descriptor, octets)

    def sync(self, descriptor: int) -> None:
        self.check()
        self._sync(descriptor)

    def check(self) -> None:
        if self.error:
            raise OSError(self.error, os.strerror(self.error))


@pytest.mark.parametrize("error", [28, 5, 30])  # ENOSPC, EIO, EROFS
def test_disk_that_takes_nothing_costs_frames_that_are_counted_and_recording_continues(
    bench, monkeypatch, capsys, error
):
    disk = Disk(monkeypatch)
    bench.record(10, 0.1)
    bench.wait(1.1)
    disk.error, disk.takes = error, 7
    bench.record(30, 0.1)
    assert bench.ring.status()["trouble"] == os.strerror(error)
    disk.error = 0
    bench.wait(1.1)
    bench.record(10, 0.1)
    bench.ring.close()
    status = bench.ring.status()
    assert (status["trouble"], status["frames"] + status["lost"], status["troubles"] > 0) == ("", 50, True)
    frames = [frame for name in bench.names() for frame in read(bench.folder / name)]
    assert len(frames) == status["frames"] == 50 - sum(frame.lost for frame in frames)
    said = capsys.readouterr().err
    assert said.count("lost") == 1
    assert tells(said, os.strerror(error).lower(), "lost", "recording continues")


def test_a_folder_that_goes_away_is_waited_for_and_not_made(tmp_path, capsys):
    folder, away = tmp_path / "card", tmp_path / "pocket"
    folder.mkdir()
    bench = Bench(folder)
    bench.record(10, 0.2)
    folder.rename(away)
    bench.record(20, 0.2)
    assert not folder.exists()
    assert bench.ring.status()["trouble"]
    away.rename(folder)
    bench.wait(1.1)
    bench.record(10, 0.2)
    bench.ring.close()
    status = bench.ring.status()
    assert status["frames"] + status["lost"] == 40
    assert bench.sequences()[-1] == 40


def test_a_file_that_somebody_removes_is_noticed_and_its_frames_are_lost(bench):
    bench.record(10, 0.2)
    (path,) = bench.folder.iterdir()
    path.unlink()
    bench.wait(1.1)
    bench.wait(1.1)
    bench.record(5, 0.2)
    bench.ring.close()
    status = bench.ring.status()
    assert (status["frames"], status["lost"]) == (5, 10)
    assert bench.sequences() == [11, 12, 13, 14, 15]


def test_room_is_left_to_others(bench, monkeypatch):
    bench.record(2000, 0.01)
    before = len(bench.names())
    monkeypatch.setattr(ring_, "_room", lambda folder: 0)
    bench.record(200, 0.01)
    assert len(bench.names()) <= 1 < before
    assert "no room" in bench.ring.status()["trouble"]


def test_a_disk_that_is_not_there_at_the_start_is_waited_for(tmp_path):
    bench = Bench(tmp_path / "card")
    bench.record(5, 0.1)
    assert bench.ring.status()["lost"] == 5
    (tmp_path / "card").mkdir()
    bench.wait(1.1)
    bench.record(5, 0.1)
    bench.ring.close()
    assert bench.sequences() == [6, 7, 8, 9, 10]


def test_a_file_goes_on_at_its_end(tmp_path):
    for first in (1, 6):
        filing = Filing(Scribe(), lambda: Segment(tmp_path / "a.pcapng"))
        filing.idle()
        for sequence in range(first, first + 5):
            filing.add(told(sequence))
        filing.end()
    assert [frame.said["sequence"] for frame in read(tmp_path / "a.pcapng")] == list(range(1, 11))
