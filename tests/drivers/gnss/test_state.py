"""State of a receiver: leap seconds announced, withdrawn, counted late."""

import calendar
import logging
import time

import pytest

from board.runtime.journal import Journal
from board.time.scales import GPS_EPOCH
from drivers.gnss.state import LATE_S, ReceiverState
from drivers.wire.gnss.time import Leap
from drivers.wire.ublox.messages import NavPvt, decode
from drivers.wire.ublox.time import NavTimeLs
from drivers.wire.ublox.ubx import Kind, UbxFrame

MIDNIGHT = calendar.timegm((2027, 1, 1, 0, 0, 0))
ANNOUNCED = Leap(18, MIDNIGHT - GPS_EPOCH + 18, 1)


class Bench:
    """A receiver's state, fed with epochs and leap seconds."""

    def __init__(self) -> None:
        self.state = ReceiverState(Journal(logging.getLogger("test"), "gnss", lambda: 0.0))

    def at(self, unix: int, message: NavTimeLs, valid: int = 7) -> Leap | None:
        """Its leap seconds after an epoch at a moment, and a message a little later."""
        when = dict(zip(("year", "month", "day", "hour", "minute", "second"), time.gmtime(unix), strict=False))
        epoch = decode(UbxFrame(Kind.NAV_PVT, bytes(92)))
        assert isinstance(epoch, NavPvt)
        self.state.take(epoch._replace(**when, valid=valid))
        self.state.take(message)
        return self.state.leap


def timels(leap: int = 18, change: int = 0, to_event_s: int = 0, valid: int = 3) -> NavTimeLs:
    return NavTimeLs(0, 0, 2, leap, 2, change, to_event_s, 0, 0, valid)


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    assert made.at(MIDNIGHT - 86_400, timels(change=1, to_event_s=86_400)) == ANNOUNCED
    return made


@pytest.mark.parametrize("valid", [1, 3])
@pytest.mark.parametrize("before_s", [86_000, 60, 3])
def test_an_announced_leap_second_that_is_withdrawn_is_forgotten(bench: Bench, before_s: int, valid: int) -> None:
    assert bench.at(MIDNIGHT - before_s, timels(valid=valid)) == Leap(18)


def test_a_leap_second_that_has_passed_is_kept_while_the_receiver_may_be_late_in_counting_it(bench: Bench) -> None:
    for since_s in (-1, 0, 1, LATE_S):
        assert bench.at(MIDNIGHT + since_s, timels(change=1, to_event_s=-since_s - 1)) == ANNOUNCED
    assert bench.at(MIDNIGHT + LATE_S + 1, timels(change=1, to_event_s=-LATE_S)) == Leap(18)


def test_a_leap_second_that_is_counted_is_no_event_any_more(bench: Bench) -> None:
    assert bench.at(MIDNIGHT, timels(leap=19, change=1, to_event_s=-1)) == Leap(19)


def test_a_date_that_is_lost_forgets_no_leap_second_that_is_still_announced(bench: Bench) -> None:
    assert bench.at(MIDNIGHT - 3600, timels(change=1, to_event_s=3600), valid=0) == ANNOUNCED
    assert bench.at(MIDNIGHT - 3600, timels(), valid=0) == Leap(18)


def test_leap_seconds_that_satellites_no_longer_vouch_for_are_not_known(bench: Bench) -> None:
    assert bench.at(MIDNIGHT - 3600, timels(valid=0)) is None
