"""AT core: answers and unsolicited codes in any chunking; late ones, silence, garbage."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from drivers.wire.at.forms import GONE, MAX_LINES, SILENT, TIMEOUT, Command, Final, command
from drivers.wire.at.lines import MAX_LINE
from drivers.wire.at.port import PROBE_S, PROBES, QUEUE, SETTLE_S, Answer, AtCore, Garbage, Unsolicited

CAPTURED = tomllib.loads((Path(__file__).parents[3] / "captures/modem.toml").read_text())
EXCHANGES = CAPTURED["exchanges"]

OK = b"\r\nOK\r\n"
CSQ = b"\r\n+CSQ: 20,99\r\n\r\nOK\r\n"


def ready():
    """Return a core whose modem has answered AT, and the current time."""
    core = AtCore()
    core.command(command("AT"), 0.0)
    assert core.take() == b"AT\r"
    core.receive(OK, 0.0)
    core.expire(SETTLE_S)
    assert core.take() == b"AT\r"
    assert [event.final.name for event in core.receive(OK, 1.0)] == ["OK"]
    return core


def asked(text, now=1.0):
    """Return a core with one command in progress."""
    core = ready()
    core.command(command(text), now)
    assert core.take() == text.encode() + b"\r"
    return core


def cut(octets, cuts):
    """Return octets cut into pieces."""
    for size in cuts:
        yield octets[:size]
        octets = octets[size:]
    yield octets


def fed(core, pieces, now=1.1):
    return [event for piece in pieces for event in core.receive(piece, now)]


def wanted(exchange):
    name, _, detail = exchange["final"].partition(" ERROR: ")
    final = exchange["final"] if not detail else f"{name} ERROR: {detail}"
    return exchange["answer"], exchange.get("unsolicited", []), final


def seen(events):
    (answer,) = [event for event in events if isinstance(event, Answer)]
    asides = [event.line for event in events if isinstance(event, Unsolicited)]
    return list(answer.lines), asides, str(answer.final)


@pytest.mark.parametrize("exchange", EXCHANGES, ids=lambda exchange: exchange["octets"].strip()[:40])
def test_every_captured_exchange_is_understood_whole_and_octet_by_octet(exchange):
    octets = exchange["octets"].encode()
    for pieces in ([octets], [octets[at : at + 1] for at in range(len(octets))]):
        core = asked(exchange["command"])
        assert seen(fed(core, pieces)) == wanted(exchange)
        assert core.garbage == 0


@given(exchange=st.sampled_from(EXCHANGES), cuts=st.lists(st.integers(1, 30)))
def test_an_answer_does_not_depend_on_how_the_octets_arrive(exchange, cuts):
    core = asked(exchange["command"])
    assert seen(fed(core, cut(exchange["octets"].encode(), cuts))) == wanted(exchange)


@given(exchange=st.sampled_from(EXCHANGES), garbage=st.binary(min_size=1, max_size=40))
def test_garbage_behind_an_answer_does_not_touch_it(exchange, garbage):
    events = fed(asked(exchange["command"]), [exchange["octets"].encode() + garbage])
    assert seen([event for event in events if isinstance(event, Answer)])[::2] == wanted(exchange)[::2]


@given(octets=st.lists(st.binary() | st.sampled_from([OK, CSQ, b"\r\n", b"\r\n> ", b"+CREG: 1\r\n", b"\r\nERROR\r\n"])))
def test_random_octets_are_answered_counted_or_ignored_and_the_core_lives_on(octets):
    core, now = asked("AT+CSQ"), 1.0
    for piece in octets:
        now += 1.0
        core.receive(piece, now)
        core.expire(now)
        assert len(core._lines.rest) <= MAX_LINE
        core.take()
    core.reset()
    core.command(command("AT+CSQ"), now)
    assert core.take() == b"AT\r"
    core.receive(OK, now)
    core.expire(core.deadline())
    core.take()
    assert seen(core.receive(CSQ, now + 2)) == (["+CSQ: 20,99"], [], "OK")


def test_a_new_core_finds_out_first_whether_anybody_answers():
    core = AtCore()
    core.command(command("AT+CSQ"), 0.0)
    assert core.take() == b"AT\r"
    assert core.receive(b"\0\0\xff\r\n+CSQ: 3,99\r\n\r\nOK\r\n", 0.1) != []
    assert core.take() == b""
    assert core.deadline() == 0.1 + SETTLE_S
    core.expire(0.1 + SETTLE_S)
    assert core.take() == b"AT+CSQ\r"


def test_commands_end_with_a_carriage_return_alone():
    assert asked("AT").take() == b""


def test_one_command_is_in_flight_and_the_urgent_overtake_the_rest():
    core = asked("AT+CSQ")
    first, second, third = (core.command(command(text), 1.0, priority) for text, priority in
                            (("AT+CREG?", 2), ("AT+CESQ", 2), ("AT+CGATT?", 0)))  # fmt: skip
    assert core.take() == b""
    order = []
    for text, answer in (
        (b"", CSQ),
        (b"AT+CGATT?\r", b"+CGATT: 1\r\n" + OK),
        (b"AT+CREG?\r", b"+CREG: 0,1\r\n" + OK),
        (b"AT+CESQ\r", b"+CESQ: 99,99,255,255,20,60\r\n" + OK),
    ):
        assert core.take() == text
        order += [event.number for event in core.receive(answer, 1.1)]
    assert order[1:] == [third, first, second]


def test_more_commands_than_the_queue_holds_are_refused():
    core = asked("AT+CSQ")
    for _ in range(QUEUE):
        core.command(command("AT"), 1.0)
    with pytest.raises(RequestError, match="wait"):
        core.command(command("AT"), 1.0)
    core.command(command("AT"), 1.0, priority=2)  # a command of another user of the port


def test_what_stands_behind_a_final_code_in_the_same_octets_does_not_answer_the_next_command():
    core = asked("AT")
    core.command(command("AT+CSQ"), 1.0)
    events = core.receive(OK + b"\r\n+CSQ: 7,99\r\n", 1.1)
    assert events[1:] == [Unsolicited("+CSQ: 7,99")]
    assert core.take() == b"AT+CSQ\r"
    assert seen(core.receive(CSQ, 1.2)) == (["+CSQ: 20,99"], [], "OK")


def test_an_answer_that_comes_late_takes_no_part_in_the_next_one():
    core = asked("AT+COPS?")
    core.command(command("AT+COPS?"), 1.0)
    (late,) = core.expire(core.deadline())
    assert late.final == TIMEOUT
    assert core.take() == b"AT\r"
    now = 12.0
    assert core.receive(b'\r\n+COPS: 0,0,"old",7\r\n' + OK, now) == []
    assert core.receive(OK, now + 0.1) == []  # answer to AT itself
    assert core.take() == b""
    core.expire(core.deadline())
    assert core.take() == b"AT+COPS?\r"
    assert seen(core.receive(b'\r\n+COPS: 0,0,"new",7\r\n' + OK, now + 2)) == (['+COPS: 0,0,"new",7'], [], "OK")


def test_ok_without_the_answer_that_was_asked_for_is_looked_into_before_the_next_command():
    core = asked("AT+CSQ")
    assert seen(core.receive(OK, 1.1)) == ([], [], "OK")
    core.command(command("AT+CSQ"), 1.1)
    assert core.take() == b"AT\r"
    assert core.receive(CSQ + OK, 1.2) == []
    core.expire(core.deadline())
    assert core.take() == b"AT+CSQ\r"


def test_a_modem_that_does_not_even_answer_at_is_silent_and_is_asked_again_with_the_next_command():
    core = AtCore()
    core.command(command("AT+CSQ"), 0.0)
    events = []
    for probe in range(PROBES):
        assert core.take() == b"AT\r"
        assert core.deadline() == pytest.approx((probe + 1) * PROBE_S)
        events += core.expire(core.deadline())
    assert [event.final for event in events] == [SILENT]
    assert (core.take(), core.deadline()) == (b"", None)
    core.command(command("AT+CSQ"), 60.0)
    assert core.take() == b"AT\r"


def test_a_modem_that_babbles_ok_for_ever_is_not_waited_for():
    core = AtCore()
    core.command(command("AT+CSQ"), 0.0)
    now = 0.0
    while core.take() != b"AT+CSQ\r":
        now += 0.1
        core.receive(OK, now)
        core.expire(now)
        assert now < 40


def test_a_prompt_that_nobody_expects_is_left_before_at_is_sent():
    core = asked("AT+CMGW")
    assert core.receive(b"\r\n> ", 1.1) == []
    core.expire(core.deadline())
    assert core.take() == b"\x1bAT\r"


@pytest.mark.parametrize(
    ("line", "final"),
    [
        ("OK", Final("OK")),
        ("ERROR", Final("ERROR")),
        ("MODEM ERROR", Final("MODEM ERROR")),
        ("COMMAND NOT SUPPORT", Final("COMMAND NOT SUPPORT")),
        ("+CME ERROR: 100", Final("+CME ERROR", 100)),
        ("+CME ERROR: operation not allowed", Final("+CME ERROR", None, "operation not allowed")),
        ("+CMS ERROR: 500", Final("+CMS ERROR", 500)),
    ],
)
def test_every_final_code_ends_a_command(line, final):
    (answer,) = asked("AT+CFUN=1").receive(f"\r\n{line}\r\n".encode(), 1.1)
    assert answer.final == final


@pytest.mark.parametrize("line", ["NO CARRIER", "BUSY", "NO ANSWER", "NO DIALTONE", "CONNECT", "CONNECT 115200"])
def test_what_ends_a_call_ends_only_a_command_that_calls(line):
    octets = f"\r\n{line}\r\n".encode()
    (answer,) = asked("ATD*99#").receive(octets, 1.1)
    assert str(answer.final).replace(": ", " ") == line
    assert not any(isinstance(event, Answer) for event in asked("AT+CSQ").receive(octets, 1.1))


def test_an_error_code_is_not_taken_before_its_line_has_ended():
    core = asked("AT+CSQ")
    assert core.receive(b"\r\nERROR", 1.1) == []
    assert core.receive(b"xyz\r\n", 1.1) == [Garbage(b"ERRORxyz", 8)]
    assert seen(core.receive(CSQ, 1.2))[2] == "OK"


def test_an_answer_has_a_bound():
    core = asked("AT+CLAC")
    (answer,) = [event for event in core.receive(b"AT+X\r\n" * 1000 + OK, 1.1) if isinstance(event, Answer)]
    assert len(answer.lines) == MAX_LINES
    assert core.garbage == (1000 - MAX_LINES) * 4


def test_when_the_port_is_gone_every_command_is_answered_so():
    core = asked("AT+CSQ")
    core.command(command("AT"), 1.0)
    core.receive(b"\r\n+CS", 1.1)
    assert [event.final for event in core.reset()] == [GONE, GONE]
    assert (core.deadline(), core.take(), core.reset()) == (None, b"", [])


def test_a_line_without_an_end_is_garbage_and_takes_no_memory():
    core, octets = asked("AT+CSQ"), 0
    for _ in range(1000):
        core.receive(b"x" * 4096, 1.1)
        octets += 4096
    assert len(core._lines.rest) <= MAX_LINE
    assert seen(core.receive(b"x\r\n" + CSQ, 1.2)) == (["+CSQ: 20,99"], [], "OK")
    assert core.garbage == octets + 1


def test_garbage_is_counted_in_full_and_shown_in_part():
    core, complaints = ready(), []
    for second in range(3600):
        complaints += core.receive(b"\xfe\x01garbage\r\n" * 10, 10.0 + second)
    assert sum(event.octets for event in complaints) == core.garbage == 3600 * 10 * 9
    assert all(isinstance(event, Garbage) and len(event.sample) <= 48 for event in complaints)


def test_a_storm_of_unsolicited_codes_does_not_keep_an_answer_back():
    core = asked("AT+CSQ")
    events = core.receive(b"\r\n+CREG: 1\r\n" * 500 + CSQ, 1.1)
    assert len(events) == 501
    assert events[-1].lines == ("+CSQ: 20,99",)


@pytest.mark.parametrize("text", ["", "A", "+CSQ", "AT+CSQ\r", "AT\x1a", "ATD\u00e4", "AT" + "x" * 511])
def test_what_is_no_command_is_refused(text):
    with pytest.raises(RequestError, match="invalid AT command"):
        command(text)


def test_several_commands_in_one_line_take_any_answer():
    assert command("AT+CSQ;+CREG?") == Command("AT+CSQ;+CREG?")
