"""Health of the board: last values, age, limits, faults."""

import json
from dataclasses import replace
from itertools import pairwise

import pytest

from board.description import Hardware
from board.health import LONGEST_S, PERIOD_S, Health
from board.runtime.errors import InterfaceError
from tests.board.boards import BOARD
from tests.virtual import VirtualLoop


class Board:
    """A remote that answers in the next turn with what a test has laid out."""

    def __init__(self, loop):
        self.loop = loop
        self.asked = []
        self.answers = {
            "rail main": {"v": 12.0, "a": 1.0, "w": 12.0},
            "rail modem": {"v": 3.3, "a": 0.5, "w": 1.65},
            "rail pi": {"v": 5.0, "a": 0.5, "w": 2.5},
            "temperature board": 40.0,
            "temperature cpu": 50.0,
            "fan": {"rpm": 4200},
        }

    def ask(self, do, arguments, done):
        what = " ".join([do, *arguments.values()])
        self.asked.append((self.loop.clock(), what))
        self.loop.soon(lambda: done(self.answers[what]))

    def times(self, what):
        return [when for when, asked in self.asked if asked == what]


@pytest.fixture
def loop():
    loop = VirtualLoop(now=0.0)
    yield loop
    loop.close()


@pytest.fixture
def board(loop):
    return Board(loop)


@pytest.fixture
def health(loop, board, caplog):
    caplog.set_level("INFO", "captain.board")
    health = Health(loop, board, BOARD)
    health.start()
    loop.run_for(0.1)
    yield health
    health.stop()


def said(caplog):
    return [(record.levelname, record.getMessage()) for record in caplog.records]


def test_everything_is_read_at_once_and_then_each_period(loop, board, health):
    loop.run_for(2 * PERIOD_S)
    assert {what: len(board.times(what)) for what in board.answers} == dict.fromkeys(board.answers, 3)


def test_the_last_values_are_told_with_their_age(loop, health):
    loop.run_for(2.0)
    status = health.status()
    assert status["rails"]["main"] == {
        "v": 12.0, "a": 1.0, "w": 12.0, "age_s": 2.1, "crossed": [], "fault": None, "hint": None,
    }  # fmt: skip
    assert status["temperatures"]["cpu"]["c"] == 50.0
    assert status["fan"]["rpm"] == 4200
    json.dumps(status)


def test_before_the_first_answer_there_is_no_value_and_no_age(loop, board):
    health = Health(loop, board, BOARD)
    assert health.status()["temperatures"]["cpu"] == {"age_s": None, "crossed": [], "fault": None, "hint": None}


@pytest.mark.parametrize(("what", "answer", "complaint"), [
    ("rail main", {"v": 11.1, "a": 1.0, "w": 11.1}, "rail main: 11.1 V is below 11.4 V"),
    ("rail main", {"v": 13.0, "a": 1.0, "w": 13.0}, "rail main: 13 V is above 12.6 V"),
    ("rail main", {"v": 12.0, "a": 4.5, "w": 54.0}, "rail main: 4.5 A is above 4 A"),
    ("rail modem", {"v": 3.65, "a": 0.1, "w": 0.4}, "rail modem: 3.65 V is above 3.6 V"),
    ("temperature board", 70.5, "temperature board: 70.5 degrees Celsius is above 70 degrees Celsius"),
])  # fmt: skip
def test_a_limit_that_is_crossed_is_said_once_and_so_is_its_end(loop, board, health, caplog, what, answer, complaint):
    normal = board.answers[what]
    board.answers[what] = answer
    loop.run_for(10 * PERIOD_S)
    assert health.complaints == [complaint]
    assert said(caplog) == [("WARNING", complaint)]
    board.answers[what] = normal
    loop.run_for(10 * PERIOD_S)
    assert health.complaints == []
    assert [level for level, _ in said(caplog)] == ["WARNING", "INFO"]
    assert "no longer" in said(caplog)[1][1]


@pytest.mark.parametrize(("answer", "complaints"), [
    ({"rpm": 0, "percent": 50.2}, ["fan: 0 rpm is below 60 rpm"]),
    ({"rpm": 2000, "percent": 50.2}, []),
    ({"rpm": 0, "percent": 0.0}, []),
    ({"rpm": 0}, []),
    ({"percent": 100.0}, []),
])  # fmt: skip
def test_a_fan_that_is_driven_and_stands_still_is_complained_of(loop, board, health, answer, complaints):
    board.answers["fan"] = answer
    loop.run_for(PERIOD_S)
    assert health.complaints == complaints
    board.answers["fan"] = {"percent": 0.0}
    loop.run_for(PERIOD_S)
    assert health.complaints == []


def test_a_value_that_wavers_about_its_limit_is_said_once(loop, board, health, caplog):
    for step in range(20):
        board.answers["temperature board"] = 70.0 + (0.2 if step % 2 == 0 else -0.2)
        loop.run_for(PERIOD_S)
    assert len(said(caplog)) == 1


def test_what_is_without_limits_is_never_complained_of(loop, board, health, caplog):
    board.answers["temperature cpu"] = 500.0
    loop.run_for(PERIOD_S)
    assert (health.complaints, said(caplog)) == ([], [])


def test_a_reading_that_fails_is_said_once_keeps_its_last_value_and_spares_the_others(loop, board, health, caplog):
    good = board.answers["rail main"]
    board.answers["rail main"] = InterfaceError("no answer from 0x40 on /dev/i2c-1", "is it fitted?")
    loop.run_for(600.0)
    assert said(caplog) == [("WARNING", "rail main: no answer from 0x40 on /dev/i2c-1\n  (is it fitted?)")]
    assert health.complaints == ["rail main: no answer from 0x40 on /dev/i2c-1"]
    status = health.status()["rails"]
    assert status["main"]["v"] == 12.0
    assert status["main"]["age_s"] > 590
    assert status["main"]["hint"] == "is it fitted?"
    assert status["modem"]["age_s"] <= PERIOD_S
    board.answers["rail main"] = good
    loop.run_for(LONGEST_S)
    assert said(caplog)[1:] == [("INFO", "rail main: answers again")]
    assert health.status()["rails"]["main"]["fault"] is None


def test_what_does_not_answer_is_asked_less_and_less_often_and_then_as_before(loop, board, health):
    board.answers["fan"] = InterfaceError("gone")
    loop.run_for(600.0)
    times = board.times("fan")
    gaps = [round(later - sooner) for sooner, later in pairwise(times)]
    assert gaps[:6] == [5, 10, 20, 40, 60, 60]
    board.answers["fan"] = {"rpm": 1}
    loop.run_for(LONGEST_S + 3 * PERIOD_S)
    assert round(board.times("fan")[-1] - board.times("fan")[-2]) == PERIOD_S


def test_a_stop_ends_it_also_for_answers_that_are_under_way(loop, board):
    health = Health(loop, board, BOARD)
    health.start()
    health.stop()
    loop.run_for(60.0)
    assert len(board.asked) == len(board.answers)
    assert health.status()["fan"] == {"age_s": None, "crossed": [], "fault": None, "hint": None}


def test_a_stopped_one_starts_again(loop, board, health):
    health.stop()
    health.start()
    loop.run_for(0.1)
    loop.run_for(PERIOD_S)
    assert [round(when, 1) for when in board.times("fan")] == [0.0, 0.1, 5.1]


def test_a_board_that_measures_nothing_asks_nothing(loop, board):
    health = Health(loop, board, Hardware("bare"))
    health.start()
    loop.run_for(60.0)
    assert (board.asked, health.status(), health.complaints) == ([], {}, [])


def test_a_fan_alone_is_read(loop, board):
    Health(loop, board, replace(BOARD, rails={}, temperatures={})).start()
    loop.run_for(0.1)
    assert board.asked == [(0.0, "fan")]
