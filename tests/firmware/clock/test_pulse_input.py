"""Pulse input: opened, lost, opened again; its log lines."""

import logging
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import pytest

from board.description import PulseDescription
from board.runtime.errors import InterfaceError
from firmware.clock.pulse_input import MOST_S, PulseInput, source
from pps.device import PulseDevice
from pps.edges import Edges
from pps.pulse import Above, Pulse, Tally, read_clocks
from tests.said import tells
from tests.virtual import VirtualLoop


class ScriptedPulses:
    """A source that fails as long as `fault` says so."""

    where = "/dev/pps0"

    def __init__(self, above: Above) -> None:
        self.above = above
        self.tally = Tally(above)
        self.fault: InterfaceError | None = None
        self.tries: list[float] = []
        self.loop: VirtualLoop | None = None
        self.stops = 0

    def start(self) -> None:
        assert self.loop is not None
        self.tries.append(self.loop.now)
        if self.fault is not None:
            raise self.fault
        self.tally.begin(0)

    def stop(self) -> None:
        self.stops += 1

    def beat(self, sequence: int) -> None:
        self.tally.take(Pulse(sequence, 0, sequence * 10**9, self.loop.now if self.loop else 0.0))


class Bench:
    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.pulses: list[Pulse] = []
        self.source: ScriptedPulses
        self.input = PulseInput(loop, self._made, self.pulses.append)
        self.source.loop = loop

    def _made(self, above: Above) -> ScriptedPulses:
        self.source = ScriptedPulses(above)
        return self.source


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


GONE = InterfaceError("/dev/pps0: No such file or directory", "load the overlay pps-gpio")


def test_pulses_are_passed_on_and_counted(bench: Bench) -> None:
    bench.input.start()
    for sequence in (1, 2, 5):
        bench.source.beat(sequence)
    status = bench.input.status()
    assert [pulse.sequence for pulse in bench.pulses] == [1, 2, 5]
    assert (status["taken"], status["missed"], status["is_open"], status["why"]) == (3, 2, True, "")


def test_a_source_that_is_absent_is_said_once_and_tried_ever_less_often(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    bench.source.fault = GONE
    bench.input.start()
    bench.loop.run_for(600)
    gaps = [round(after - before) for before, after in pairwise(bench.source.tries)]
    assert gaps[:6] == [1, 2, 4, 8, 16, 30]
    assert set(gaps[6:]) == {MOST_S}
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "load the overlay" in caplog.text
    status = bench.input.status()
    assert (status["is_open"], status["why"], status["hint"]) == (False, GONE.message, GONE.hint)


def test_pulse_input_that_appears_is_opened_and_logged(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    bench.source.fault = GONE
    bench.input.start()
    bench.source.fault = None
    bench.loop.run_for(2)
    bench.source.beat(1)
    assert len(bench.pulses) == 1
    assert tells(caplog.messages[-1], "/dev/pps0: ", "open")
    assert bench.input.status()["why"] == ""


def test_one_that_fails_while_it_runs_is_tried_again(bench: Bench) -> None:
    bench.input.start()
    bench.source.beat(1)
    bench.source.above.failed(GONE)
    assert not bench.input.is_open
    bench.loop.run_for(2)
    assert bench.input.is_open
    assert bench.input.status()["failures"] == 1


def test_after_a_stop_nothing_is_tried(bench: Bench) -> None:
    bench.source.fault = GONE
    bench.input.start()
    bench.input.stop()
    bench.input.stop()
    bench.loop.run_for(100)
    assert len(bench.source.tries) == 1


@pytest.mark.parametrize(
    ("pulse", "kind", "where"),
    [
        (PulseDescription(device="/dev/pps0"), PulseDevice, "/dev/pps0"),
        (PulseDescription(chip="gpiochip0", offset=18, edge="falling"), Edges, "18"),
        (PulseDescription(line="GPIO18"), Edges, "GPIO18"),
    ],
)
def test_the_source_is_what_the_board_file_names(
    bench: Bench, tmp_path: Path, pulse: PulseDescription, kind: type, where: str
) -> None:
    made = source(bench.loop, pulse, tmp_path, bench.input, read_clocks)
    assert isinstance(made, kind)
    assert where in made.where
