"""Operator's requests to a running station, and their refusals."""

from collections.abc import Iterator, Mapping
from contextlib import closing

import pytest

from board.runtime.errors import RequestError, StationError
from drivers.contract import Answer
from firmware.endpoint.control.question import Commands, Pending
from firmware.station import carrier as carrier_module
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.operator import Operator
from firmware.station.position import OwnPosition
from firmware.station.timeline import MOST, Timeline
from tests.firmware.doubles import NotingStation, ScriptedDriver, interface_of
from tests.firmware.whole_board import NO_CLOCK, NearBoardWorker, WholeBoard
from tests.said import tells
from tests.virtual import VirtualLoop


class AskableDriver(ScriptedDriver):
    """An Operated one that answers with what it was asked, later."""

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        if do == "explode":
            answer(RequestError("it cannot", "do not ask"))
        else:
            self.later = lambda: answer({"did": do, "with": dict(arguments)})


class Bench:
    def __init__(self, loop: VirtualLoop, board: WholeBoard | None = None) -> None:
        self.loop = loop
        self.askable = AskableDriver()
        drivers = {"modem": self.askable, "g5": ScriptedDriver()}
        self.interfaces = {
            name: InterfaceSupervisor(loop, interface_of(loop, NotingStation(), driver, name))
            for name, driver in drivers.items()
        }
        self.interfaces["modem"].start()
        self.operator = Operator(
            loop,
            self.interfaces,
            lambda: board.carrier if board else None,
            OwnPosition(loop.clock, None, is_mobile=True),
            lambda: NO_CLOCK,
            Timeline(loop.clock),
        )
        self.answers: list[dict[str, object]] = []

    def ask(self, line: str) -> dict[str, object] | None:
        """The answer, where it came at once."""
        before = len(self.answers)
        Commands(self.operator.now, self.operator.later).ask(line.encode(), Pending(self.loop, self.answers.append))
        return self.answers[-1] if len(self.answers) > before else None


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


@pytest.fixture
def with_board(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(carrier_module, "BoardWorker", NearBoardWorker)
    with closing(VirtualLoop()) as loop, closing(WholeBoard(loop)) as board:
        board.start()
        board.until_up()
        yield Bench(loop, board)


def test_a_driver_is_asked_and_answers_later(bench: Bench) -> None:
    line = '{"do": "operate", "interface": "modem", "ask": "at", "arguments": {"command": "ATI"}}'
    assert bench.ask(line) is None
    bench.askable.later()
    assert bench.answers == [{"ok": True, "did": "at", "with": {"command": "ATI"}}]


def test_what_a_driver_refuses_is_told(bench: Bench) -> None:
    answer = bench.ask('{"do": "operate", "interface": "modem", "ask": "explode"}')
    assert answer == {"ok": False, "error": "it cannot", "hint": "do not ask"}


@pytest.mark.parametrize(
    ("question", "error", "hint"),
    [
        ('"interface": "modm", "ask": "at"', "interface: 'modm' is not known", "did you mean modem?"),
        ('"ask": "at"', "interface: is missing", "known: modem, g5"),
        ('"interface": ["modem"], "ask": "at"', "interface: ['modem'] is not known", "did you mean modem?"),
        ('"interface": "modem"', "ask: is missing", "give a text"),
        ('"interface": "modem", "ask": "at", "arguments": 5', "arguments: 5 is not an object", 'give {"name": value}'),
        ('"interface": "g5", "ask": "at"', "interface g5 (scripted) accepts no commands", "one of modem"),
    ],
)
def test_a_question_that_means_nothing_is_refused_with_what_to_do(
    bench: Bench, question: str, error: str, hint: str
) -> None:
    assert bench.ask(f'{{"do": "operate", {question}}}') == {"ok": False, "error": error, "hint": hint}


def test_request_to_a_driver_that_does_not_run_is_refused_with_its_state(bench: Bench) -> None:
    bench.interfaces["modem"].interface.fail(StationError("gone"))
    answer = bench.ask('{"do": "operate", "interface": "modem", "ask": "at"}')
    assert answer is not None
    assert tells(str(answer["error"]), "interface modem ", "waiting: gone")
    assert "`captain status`" in str(answer["hint"])


def test_request_to_a_board_without_slots_is_refused(bench: Bench) -> None:
    answer = bench.ask('{"do": "slot", "ask": "list"}')
    assert answer is not None
    assert "no slots" in str(answer["error"])
    assert "`captain run --board`" in str(answer["hint"])
    assert bench.ask('{"do": "board"}') == {"ok": True, "board": None, "timeline": []}


def test_a_self_test_without_a_board_looks_at_the_interfaces(bench: Bench) -> None:
    bench.interfaces["g5"].start()
    answer = bench.ask('{"do": "selftest"}')
    assert answer is not None
    assert [(row["capability"], row["works"]) for row in answer["rows"]] == [
        ("interface modem", True),
        ("interface g5", True),
    ]


def test_slots_are_listed_with_what_is_in_them(with_board: Bench) -> None:
    answer = with_board.ask('{"do": "slot", "ask": "list"}')
    assert answer is not None
    found = {name: (slot["state"], slot["device"][:9]) for name, slot in answer["slots"].items()}
    assert found == {
        "gnss": ("running", "1546:01a9"),
        "free": ("unused", ""),
        "v2x": ("unused", ""),
        "cellular": ("running", "1e0e:9001"),
    }


@pytest.mark.parametrize("name", ["gnss", "1"])
def test_a_slot_is_switched_by_name_or_number(with_board: Bench, name: str) -> None:
    answer = with_board.ask(f'{{"do": "slot", "ask": "off", "slot": "{name}"}}')
    assert answer is not None
    assert answer["slots"]["gnss"]["state"] == "off"


@pytest.mark.parametrize(
    ("question", "error"),
    [
        ('"ask": "of", "slot": "gnss"', "ask: 'of' is not known"),
        ('"ask": "off"', "slot: is missing"),
        ('"ask": "off", "slot": "5"', "slot: '5' is not known"),
        ('"ask": "off", "slot": "0"', "slot: '0' is not known"),
        ('"ask": "off", "slot": 1', "slot: 1 is not known"),
    ],
)
def test_a_slot_that_there_is_not_is_refused(with_board: Bench, question: str, error: str) -> None:
    answer = with_board.ask(f'{{"do": "slot", {question}}}')
    assert answer is not None
    assert (answer["ok"], answer["error"]) == (False, error)
    assert answer["hint"]


def test_a_time_line_keeps_the_start_and_no_more() -> None:
    timeline = Timeline(lambda: 5.0)
    for number in range(2 * MOST):
        timeline.note("g5", f"note {number}")
    assert [row["what"] for row in timeline.status()] == [f"note {number}" for number in range(MOST)]
