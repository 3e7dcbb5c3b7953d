"""Pulses of a GPIO line: stamps by all clocks, edges that are missing, storms, chips that go."""

import errno
import os

import pytest

from board.description import LineDescription
from board.edges import BUFFER
from board.runtime.errors import InterfaceError
from pps.edges import SILENT_S, Edges
from pps.pulse import OLDEST_NS, REST_S, STORM_NS, Clocks, Pulse
from tests.board.gpio import Clock, Edge, Gpio
from tests.pps.above import Told

SECOND = 10**9
LATE_NS = 60_000  # the loop reads an edge so long after it
SYSTEM_NS, RAW_NS = 1_700_000_000 * SECOND, -3 * SECOND  # of the clocks where CLOCK_MONOTONIC is 0


class Bench:
    """A line, its chip as the test drives it, and the loop's clock, by which the kernel stamps as well."""

    def __init__(self, loop, told, gpio, **options):
        self.loop = loop
        self.told = told
        self.chip = gpio.add("gpiochip0", "pinctrl-bcm2711", names=[*(f"GPIO{n}" for n in range(28))])
        line = options.pop("line", LineDescription(chip="pinctrl-bcm2711", offset=18))
        self.edges = Edges(loop, line, told, dev=gpio.dev, clocks=self.clocks, **options)

    @property
    def now_ns(self):
        return round(self.loop.now * 1e9)

    def clocks(self):
        return Clocks(SYSTEM_NS + self.now_ns, RAW_NS + self.now_ns, self.loop.now)

    def edge(self, late_ns=LATE_NS, count=1):
        """Edges of some moment, which the loop reads so long after it."""
        self.chip.edge(18, self.now_ns - late_ns, count)
        self.loop.turn()


@pytest.fixture
def told():
    return Told()


@pytest.fixture
def make(loop, told, monkeypatch, tmp_path):
    made = []

    def make(**options):
        made.append(Bench(loop, told, Gpio(monkeypatch, tmp_path), **options))
        return made[-1]

    yield make
    for bench in made:
        bench.edges.stop()


@pytest.fixture
def bench(make):
    bench = make()
    bench.edges.start()
    return bench


def test_an_edge_is_told_with_when_it_was_by_each_clock(bench, told):
    stamp_ns = bench.now_ns - LATE_NS
    bench.edge()
    assert told.all == [Pulse(1, SYSTEM_NS + stamp_ns, RAW_NS + stamp_ns, stamp_ns / 1e9)]


def test_edges_of_seconds_are_told_one_by_one(bench, told):
    for _ in range(100):
        bench.loop.run_for(1.0)
        bench.edge()
    assert [pulse.sequence for pulse in told.all] == list(range(1, 101))
    tally = bench.edges.tally
    assert (tally.taken, tally.missed, tally.extra) == (100, 0, 0)


@pytest.mark.parametrize(("kind", "edge"), [("rising", Edge.RISING), ("falling", Edge.FALLING)])
def test_the_kernel_is_asked_for_one_kind_of_edge_by_a_clock_that_nobody_steps(make, kind, edge):
    bench = make(kind=kind)
    bench.edges.start()
    settings = bench.chip.inputs[18].settings
    assert (settings.edge_detection, settings.event_clock) == (edge, Clock.MONOTONIC)


def test_a_line_is_found_by_its_name(make):
    bench = make(line=LineDescription(line="GPIO18"))
    bench.edges.start()
    assert bench.chip.users == {18: "captain"}
    assert bench.edges.where == "GPIO18"


def test_edges_beyond_what_the_kernel_keeps_are_missed(bench, told):
    bench.edge(count=BUFFER + 7)
    assert told.all[0] == 7
    assert len(told.pulses) == BUFFER


def test_an_edge_that_waited_too_long_for_the_loop_is_missed(bench, told):
    bench.edge(late_ns=OLDEST_NS + 1)
    assert told.all == []
    bench.loop.run_for(1.0)
    bench.edge()
    assert [what if isinstance(what, int) else what.sequence for what in told.all] == [1, 2]


def test_in_a_storm_of_edges_others_have_their_turn_and_the_newest_are_had(bench, told):
    bench.edge()
    bench.loop.now += (STORM_NS - 1000) / 1e9
    bench.edge()
    bench.edge(count=1000)  # the loop rests: nobody reads
    assert [pulse.sequence for pulse in told.pulses] == [1, 2]
    bench.loop.run_for(REST_S)
    bench.loop.turn()
    assert told.gaps == [1000 - BUFFER]
    assert told.pulses[-1].sequence == 1002


def test_a_storm_costs_no_more_than_twenty_looks_a_second(bench, monkeypatch):
    looks = []
    read = bench.edges._line.read
    monkeypatch.setattr(bench.edges._line, "read", lambda: looks.append(bench.loop.now) or read())
    end = bench.loop.after(10.0, lambda: None)
    while end.is_pending:
        bench.chip.edge(18, bench.now_ns)
        bench.loop.turn()
    assert len(looks) <= 10 / REST_S + 2


def test_a_chip_that_is_gone_is_told_once_when_it_is_read_and_may_be_started_again(bench, told):
    bench.chip.failure = OSError(errno.ENODEV, os.strerror(errno.ENODEV))
    bench.edge()
    (error,) = told.all
    assert str(error).startswith("pinctrl-bcm2711, line 18: No such device")
    assert bench.chip.users == {}
    bench.chip.failure = None
    bench.edges.start()
    bench.edge()
    assert told.all[1].sequence == 1


def test_a_chip_that_is_gone_is_told_when_no_edge_has_come_for_a_while(bench, told):
    bench.edge()
    bench.chip.failure = OSError(errno.ENODEV, os.strerror(errno.ENODEV))
    bench.loop.run_for(SILENT_S)
    assert isinstance(told.all[1], InterfaceError)
    bench.loop.run_for(100.0)
    assert len(told.all) == 2


def test_a_line_without_edges_is_no_trouble_while_its_chip_is_there(bench, told):
    bench.loop.run_for(100.0)
    bench.edge()
    assert len(told.pulses) == 1


@pytest.mark.parametrize(("user", "hint"), [("pps@12", "/dev/pps0"), ("somebody", "gpioinfo")])
def test_a_line_that_another_has_is_said_with_its_user(make, user, hint):
    bench = make()
    bench.chip.users[18] = user
    with pytest.raises(InterfaceError, match=f"line 18: in use by {user}") as refused:
        bench.edges.start()
    assert hint in refused.value.hint


@pytest.mark.parametrize(("failure", "words", "hint"), [
    (errno.EACCES, "line 18: Permission denied", "adduser USER gpio"),
    (errno.ENODEV, "line 18: No such device", "interrupt"),
    (errno.EINVAL, "line 18: Invalid argument", "gpioinfo"),
])  # fmt: skip
def test_a_line_that_cannot_be_had_is_refused_with_what_to_do(make, failure, words, hint):
    bench = make()
    bench.chip.failure = OSError(failure, os.strerror(failure))
    with pytest.raises(InterfaceError, match=words) as refused:
        bench.edges.start()
    assert hint in refused.value.hint


def test_a_line_that_is_not_there_is_refused(make):
    with pytest.raises(InterfaceError, match="no line of any GPIO chip is named GPIO99"):
        make(line=LineDescription(line="GPIO99")).edges.start()


def test_nothing_is_told_after_the_end_and_the_line_is_free(bench, told):
    bench.chip.edge(18, bench.now_ns)
    bench.edges.stop()
    bench.edges.stop()
    bench.loop.run_for(10.0)
    assert (told.all, bench.chip.users) == ([], {})


def test_starting_twice_is_starting_once(bench, told):
    bench.edges.start()
    bench.edge()
    assert len(told.all) == 1


@pytest.mark.parametrize("count", [1, 5, BUFFER + 3])
def test_whoever_hears_may_stop_it(bench, told, count):
    told.then = bench.edges.stop
    bench.edge(count=count)
    bench.loop.run_for(10.0)
    assert len(told.all) == 1


def test_whoever_hears_may_stop_it_and_start_it_again(bench, told):
    def again():
        told.then = lambda: None
        bench.edges.stop()
        bench.edges.start()

    told.then = again
    bench.edge()
    bench.loop.run_for(1.0)
    bench.edge()
    assert [pulse.sequence for pulse in told.all] == [1, 1]
