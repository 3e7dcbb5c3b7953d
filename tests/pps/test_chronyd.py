"""A real chronyd, fed as the station feeds it: what it makes of that, and what happens when it ends or hangs."""

import logging
import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from board.runtime.journal import Journal
from board.time.leaps import LIST
from board.time.scales import LeapEvent
from pps.chrony.configuration import access, configuration, refclock
from pps.chrony.feed import Fate
from pps.chrony.tracking import Tracker
from tests.pps.chronyd import PROGRAM, Chronyd, Feeder, event, shift_to
from tests.virtual import VirtualLoop

SETTLED_S = 10e-6  # of what was injected
LASTING = 5  # updates


class Chronyds:
    """Makes chronyds and what feeds them, and ends them all."""

    def __init__(self, folder: Callable[[], Path]) -> None:
        self._folder = folder
        self._closing = ExitStack()

    def __call__(self, **how: int) -> Chronyd:
        """A running one: the words of Chronyd."""
        return self._closing.enter_context(Chronyd(self._folder(), **how))

    def feeder(self, chronyd: Chronyd) -> Feeder:
        feeder = Feeder(chronyd)
        self._closing.callback(feeder.refclock.close)
        return feeder

    def close(self) -> None:
        self._closing.close()


@pytest.fixture
def chronyds(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chronyds]:
    with closing(Chronyds(lambda: tmp_path_factory.mktemp("chronyd"))) as made:
        yield made


def test_it_selects_the_refclock_and_follows_steps_of_half_a_millisecond(chronyds: Chronyds) -> None:
    chronyd = chronyds()
    feed = chronyds.feeder(chronyd)

    state = chronyd.until(feed, lambda state: state.reference == "PPS")
    assert (state.reference_id, state.stratum, state.leap) == ("50505300", 1, "Normal")
    for offset_ns in (0, 500_000, 0, -500_000):
        feed.offset_ns = offset_ns
        state = chronyd.until(
            feed, lambda state: abs(state.system_offset_s - feed.offset_ns / 1e9) < SETTLED_S, LASTING
        )
        assert state.offset_ns is not None
        assert abs(state.offset_ns - offset_ns) < 10_000
        assert state.uncertainty_ns is not None


def test_no_nanosecond_is_lost_on_the_way(chronyds: Chronyds) -> None:
    # Stamps end anywhere within their microsecond: an offset made against the microseconds alone would be wrong by
    # half of one on average.
    chronyd = chronyds()
    feed = chronyds.feeder(chronyd)
    feed.offset_ns = 12_345
    chronyd.until(feed, lambda state: state.offset_ns is not None and abs(state.offset_ns - 12_345) < 20, LASTING)


@pytest.mark.parametrize(
    ("now", "announced", "said"),
    [
        ("2030-12-31T12:00:00", event("2031-01-01", 1), "Insert second"),
        ("2030-06-30T12:00:00", event("2030-07-01", 1), "Insert second"),
        ("2030-12-31T12:00:00", event("2031-01-01", -1), "Delete second"),
        ("2030-12-31T12:00:00", None, "Normal"),
        ("2030-12-30T12:00:00", event("2031-01-01", 1), "Normal"),
        ("2030-03-31T12:00:00", event("2030-04-01", 1), "Normal"),  # chronyd leaves it out in other months
    ],
)
def test_an_announced_leap_second_is_told_on_its_day(
    chronyds: Chronyds, now: str, announced: LeapEvent | None, said: str
) -> None:
    chronyd = chronyds(shift_s=shift_to(now))
    feed = chronyds.feeder(chronyd)
    feed.leap = announced

    chronyd.until(feed, lambda state: state.leap == said, LASTING)


def test_it_is_found_again_when_it_was_started_again(chronyds: Chronyds, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    chronyd = chronyds()
    feed = chronyds.feeder(chronyd)
    chronyd.until(feed, lambda state: state.is_synchronised)

    chronyd.stop()
    assert not feed()
    assert not feed()
    chronyd.start()
    chronyd.until(feed, lambda state: state.is_synchronised)
    chronyd.stop(signal.SIGKILL)  # its socket stays behind
    assert not feed()
    chronyd.start()
    chronyd.until(feed, lambda state: state.is_synchronised)

    lines = [record.message.split(": ", 2)[2] for record in caplog.records]
    assert [line.split(" (")[0].split(":")[0] for line in lines] == [
        "chronyd accepts samples",
        "chronyd gets no samples",
        "chronyd accepts samples",
        "chronyd gets no samples",
        "chronyd accepts samples",
    ]


def test_one_that_hangs_holds_nobody_up_and_takes_no_old_samples_afterwards(chronyds: Chronyds) -> None:
    chronyd = chronyds()
    feed = chronyds.feeder(chronyd)
    chronyd.until(feed, lambda state: state.is_synchronised)

    chronyd.freeze()
    while feed():
        pass
    assert feed.refclock.counts[Fate.FULL] == 1
    chronyd.thaw()
    feed.offset_ns = 100_000
    chronyd.until(feed, lambda state: abs(state.system_offset_s - 1e-4) < SETTLED_S, LASTING)


def test_the_loop_learns_what_it_says(chronyds: Chronyds, loop: VirtualLoop) -> None:
    chronyd = chronyds()
    feed = chronyds.feeder(chronyd)
    feed.offset_ns = 250_000
    chronyd.until(feed, lambda state: abs(state.system_offset_s - 250e-6) < SETTLED_S, LASTING)

    tracker = Tracker(loop, Journal(logging.getLogger("test"), "chrony", loop.clock), chronyd.chronyc)
    loop.is_carrying = lambda: tracker.is_asking
    tracker.start()
    loop.run_until(lambda: tracker.answered == 1)
    assert tracker.latest is not None
    assert tracker.latest.reference == "PPS"
    assert tracker.latest.offset_ns is not None
    assert abs(tracker.latest.offset_ns - 250_000) < 10_000
    tracker.stop()


def reads(text: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    """chronyd itself reads a configuration and prints it."""
    file = folder / "chrony.conf"
    file.write_text(text)
    return subprocess.run([PROGRAM, "-p", "-f", str(file)], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "text", [refclock(), configuration(leaps="right/UTC"), refclock("/run/chrony.other.sock", latency_ns=0)]
)
def test_chronyd_reads_every_line_that_is_written_for_it(text: str, tmp_path: Path) -> None:
    read = reads(text, tmp_path)

    assert (read.returncode, read.stderr) == (0, "")
    assert read.stdout.splitlines() == [line for line in text.splitlines() if line and not line.startswith("#")]


def test_chronyd_finds_a_wrong_line(tmp_path: Path) -> None:
    read = reads(refclock().replace("poll", "pol"), tmp_path)

    assert read.returncode != 0
    assert "Invalid refclock option" in read.stderr


def test_the_list_of_leap_seconds_is_the_only_line_that_an_older_chronyd_does_not_know(tmp_path: Path) -> None:
    # Debian 13 has chronyd 4.6 with `leapseclist`, Debian 12 has 4.3 with `leapsectz` alone.
    text = configuration()
    line = f"leapseclist {LIST}\n"

    assert line in text
    assert reads(text.replace(line, ""), tmp_path).returncode == 0


def test_chronyd_runs_with_what_is_written_for_it(chronyds: Chronyds, tmp_path: Path) -> None:
    text = configuration(str(tmp_path / "pps.sock"), leaps="right/UTC", state=str(tmp_path))
    text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("bindcmdaddress"))
    with Chronyd(tmp_path, text.replace("{", "{{").replace("}", "}}")) as chronyd:
        feed = chronyds.feeder(chronyd)
        assert feed()
        assert chronyd.tracking().leap == "Not synchronised"  # samples are taken together each 4 s
        chronyd.stop()
    assert "Fatal" not in chronyd.log


def test_its_socket_is_for_its_own_user_alone(chronyds: Chronyds) -> None:
    # Why access() is needed: a station that is not root may not write to it.
    mode = chronyds().socket.stat().st_mode & 0o777
    umask = os.umask(0)
    os.umask(umask)
    assert mode == 0o777 & ~umask
    assert "chgrp captain /run/chrony.captain.sock" in access("captain")
