"""Journal: repeated decisions are counted, not logged again."""

import logging
import re

import pytest

from board.runtime.journal import DECISIONS, REPEATS, Journal, Rate

RATES = pytest.mark.parametrize("rate", [DECISIONS, REPEATS], ids=["decisions", "repeats"])


class Bench:
    def __init__(self, rate: Rate) -> None:
        self.now = 1000.0
        self.journal = Journal(logging.getLogger("test.journal"), "gnss", lambda: self.now, rate)

    def say(self, text: str = "it jumped", about: str = "") -> None:
        self.journal.say(logging.WARNING, text, about)


@RATES
def test_as_many_lines_as_a_start_has_are_written_at_once(caplog: pytest.LogCaptureFixture, rate: Rate) -> None:
    bench = Bench(rate)
    for _ in range(100):
        bench.say()
    assert caplog.messages == ["gnss: it jumped"] * rate.burst


@RATES
def test_then_one_is_written_each_time_that_its_turn_has_come(caplog: pytest.LogCaptureFixture, rate: Rate) -> None:
    bench = Bench(rate)
    for _ in range(1000):
        bench.say()
        bench.now += 1.0
    assert len(caplog.messages) == rate.burst + 999 // rate.every_s


def test_line_after_omitted_ones_gives_their_count(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(REPEATS)
    for _ in range(60):
        bench.say()
        bench.now += 1.0
    bench.say()
    bench.say()
    bench.now += 60.0
    bench.say()
    bench.now += 60.0
    bench.say()
    assert [re.findall(r"\d+", message) for message in caplog.messages] == [[], ["59"], ["1"], []]
    assert all(message.startswith("gnss: it jumped") for message in caplog.messages)
    assert ["omitted" in message for message in caplog.messages] == [False, True, True, False]


def test_each_subject_has_the_rate_for_itself(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(REPEATS)
    for _ in range(5):
        bench.say("jamming: critical", "jamming")
        bench.say("antenna: open", "antenna")
    assert caplog.messages == ["gnss: jamming: critical", "gnss: antenna: open"]


def test_after_a_silence_a_whole_start_is_written_again(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(DECISIONS)
    for _ in range(DECISIONS.burst):
        bench.say()
    bench.now += DECISIONS.burst * DECISIONS.every_s
    for _ in range(DECISIONS.burst + 1):
        bench.say()
    assert len(caplog.messages) == 2 * DECISIONS.burst
