"""Output of chronyc: parsed or explained, without waiting."""

import logging
import math
from collections.abc import Iterator
from contextlib import closing

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from board.runtime.journal import Journal
from pps.chrony.tracking import LIMIT_S, PERIOD_S, Tracker, tracking
from tests.said import tells
from tests.virtual import VirtualLoop

# Of chronyd 4.3 with a refclock SOCK that is 500 us ahead of the system's clock.
LINE = (
    "50505300,PPS,1,1795367851.500000000,0.000500000,-0.000000012,0.000110650,-0.250,0.001,0.013,0.000010000,"
    "0.000001055,0.1,Normal\n"
)
NOBODY = "00000000,,0,0.000000000,0.000000000,0.0,0.0,0.000,0.000,0.000,1.000000000,1.000000000,0.0,Not synchronised\n"


def test_a_line_is_read_with_its_units() -> None:
    state = tracking(LINE)

    assert (state.reference_id, state.reference, state.stratum, state.leap) == ("50505300", "PPS", 1, "Normal")
    assert state.updated_unix_s == 1795367851.5
    assert (state.frequency_ppm, state.residual_ppm, state.skew_ppm) == (-0.25, 0.001, 0.013)
    assert (state.last_offset_s, state.rms_offset_s, state.update_interval_s) == (-12e-9, 110.65e-6, 0.1)
    assert state.offset_ns == 500_000
    assert state.uncertainty_ns == 1_055 + 10_000 // 2


def test_one_that_is_not_synchronised_knows_nothing() -> None:
    state = tracking(NOBODY)

    assert not state.is_synchronised
    assert (state.offset_ns, state.uncertainty_ns) == (None, None)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "506 Cannot talk to daemon",
        LINE.replace(",Normal", ""),
        LINE.replace(",PPS", ",PPS,PPS"),
        LINE.replace("Normal", "Insert minute"),
        LINE.replace("0.000500000", "nan"),
        LINE.replace("0.000500000", "-inf"),
        LINE.replace("0.000500000", "1e400"),
        LINE.replace("0.000500000", "half"),
        LINE.replace("0.000500000", ""),
        LINE.replace("50505300", "PPS!"),
        LINE.replace(",1,", ",one,"),
        LINE + LINE,
        "\0" * 200,
    ],
)
def test_anything_else_is_explained(text: str) -> None:
    with pytest.raises(ProtocolError, match=r"of chronyc|of chronyd"):
        tracking(text)


@example(LINE)
@given(
    st.one_of(
        st.text(),
        st.lists(st.sampled_from([*LINE.strip().split(","), "-1", "1e300", "nan", ""]), min_size=13, max_size=15).map(
            ",".join
        ),
    )
)
def test_a_text_is_taken_or_explained(text: str) -> None:
    try:
        state = tracking(text)
    except ProtocolError as error:
        assert len(str(error)) < 300
    else:
        assert all(math.isfinite(one) for one in state[3:13])  # type: ignore[arg-type]
        assert (state.offset_ns is None) == (state.uncertainty_ns is None)


class Trackers:
    """Made on one loop, whose clock stands still while one of them asks; what they started is reaped at the end."""

    def __init__(self, loop: VirtualLoop) -> None:
        self._loop = loop
        self._made: list[Tracker] = []
        loop.is_carrying = lambda: any(one.is_asking for one in self._made)

    def __call__(self, *command: str) -> Tracker:
        self._made.append(Tracker(self._loop, Journal(logging.getLogger("test"), "chrony", self._loop.clock), command))
        return self._made[-1]

    def close(self) -> None:
        for one in self._made:
            one.stop()
        self._loop.is_carrying = lambda: True
        self._loop.run_until(lambda: not self._loop._sources)


@pytest.fixture
def trackers(loop: VirtualLoop) -> Iterator[Trackers]:
    with closing(Trackers(loop)) as made:
        yield made


def test_chronyc_is_asked_at_once_and_each_period(loop: VirtualLoop, trackers: Trackers) -> None:
    tracker = trackers("printf", LINE.replace("\n", "%.0s"))
    tracker.start()
    tracker.start()
    loop.run_until(lambda: tracker.answered == 1)
    first = loop.now
    assert tracker.latest == tracking(LINE)

    loop.run_until(lambda: tracker.answered == 3)
    assert loop.now - first == pytest.approx(2 * PERIOD_S)
    assert tracker.asked == 3
    tracker.stop()
    assert tracker.latest is None


def test_chronyc_that_is_absent_is_logged_once_with_its_package(
    loop: VirtualLoop, trackers: Trackers, caplog: pytest.LogCaptureFixture
) -> None:
    tracker = trackers("no-such-chronyc")
    tracker.start()
    loop.run_for(10 * PERIOD_S)

    assert tracker.asked >= 10
    assert tracker.latest is None
    (record,) = caplog.records
    assert tells(record.message, "chrony: ", ": no-such-chronyc ", "not installed", "apt install no-such-chronyc")


def test_chronyd_that_does_not_run_is_logged_once(
    loop: VirtualLoop, trackers: Trackers, caplog: pytest.LogCaptureFixture
) -> None:
    tracker = trackers("sh", "-c", "echo 506 Cannot talk to daemon; exit 1")
    tracker.start()
    loop.run_until(lambda: tracker.asked == 3)

    (record,) = caplog.records
    assert tells(record.message, "chrony: ", "unknown: status 1: 506 Cannot talk")


def test_an_answer_that_is_none_takes_the_last_one_away(
    loop: VirtualLoop, trackers: Trackers, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    tracker = trackers("printf", LINE.replace("\n", "%.0s"))
    tracker.start()
    loop.run_until(lambda: tracker.answered == 1)

    good, tracker._command = tracker._command, ("echo", "what?")
    loop.run_until(lambda: bool(tracker.why))
    assert tracker.latest is None
    assert "'what?'" in tracker.why

    tracker._command = good
    loop.run_until(lambda: tracker.answered == 2)
    assert tracker.latest is not None
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO"]


def test_a_chronyc_that_hangs_is_ended(loop: VirtualLoop, trackers: Trackers) -> None:
    tracker = trackers()
    tracker._command = ("sleep", "1000")
    loop.is_carrying = lambda: loop.now - began >= LIMIT_S  # it is on its way once it was told to end
    began = loop.now
    tracker.start()
    loop.run_until(lambda: bool(tracker.why))

    assert loop.now - began == pytest.approx(LIMIT_S)
    assert "status -15" in tracker.why
