"""Operator's requests to the modem; dangerous ones need force."""

import logging

import pytest

from board.runtime.errors import RequestError, StuckError
from drivers.sim.modem.commands import IMEI
from tests.said import tells

PATIENCE_S = 0.0  # ptys tell when octets are on their way


@pytest.fixture
def bench(make_modem):
    return make_modem()


def asked(bench, do, **arguments):
    answers = []
    bench.driver.operate(do, arguments, answers.append)
    bench.loop.run_until(lambda: answers)
    bench.loop.run_for(1)
    assert len(answers) == 1
    return answers[0]


def test_an_operator_is_given_the_answer_as_it_came(bench):
    bench.up()
    assert asked(bench, "at", command="AT+CSQ") == {"command": "AT+CSQ", "result": "OK", "lines": ["+CSQ: 20,99"]}
    assert asked(bench, "at", command="AT+NONSENSE?") == {"command": "AT+NONSENSE?", "result": "ERROR", "lines": []}
    assert asked(bench, "at", command="AT+CGSN")["lines"] == [IMEI]


@pytest.mark.parametrize(
    "text",
    ["AT+CFUN=0", "AT+CPOF", "AT+CRESET", 'AT+CPIN="1"', "ATD123;", "AT+CSQ;+CFUN=0", "AT&F", "AT+COPS=?", "ATZ",
     "AT+CUSBCFG=usbid,1e0e,9011", "AT+CLCK=\"SC\",0,\"1\"", "AT+CGATT=0?"],
)  # fmt: skip
def test_what_may_change_the_modem_is_refused_unless_forced(bench, text):
    bench.up()
    assert isinstance(asked(bench, "at", command=text), RequestError)
    assert text not in bench.modem.asked


def test_an_operator_who_asks_too_much_disturbs_nobody(bench, loop):
    bench.up()
    answers = []
    for _ in range(100):
        bench.driver.operate("at", {"command": "AT+CSQ"}, answers.append)
    loop.run_for(120)
    assert len(answers) == 100
    assert sum(isinstance(answer, RequestError) for answer in answers) >= 90
    assert bench.station.is_up
    assert not any("next:" in why for why in bench.station.steps)


def test_temperature_that_is_unknown_is_not_logged(bench, loop, caplog):
    bench.up()
    bench.modem.celsius = 75
    loop.run_for(100)
    bench.modem.lies = lambda text: "\r\nERROR\r\n" if text == "AT+CPMUTEMP" else None
    caplog.clear()
    with caplog.at_level(logging.INFO):
        loop.run_for(200)
        assert not caplog.records
        bench.modem.celsius, bench.modem.lies = 40, lambda text: None
        loop.run_for(200)
    (record,) = caplog.records
    assert tells(record.message, "bench: 40 C; ", "-30 to 70 C")


def test_a_message_is_nothing_that_a_bearer_takes(bench):
    bench.up()
    with pytest.raises(RequestError, match="bench is a bearer"):
        bench.driver.send(None)


def test_forced_it_is_sent(bench):
    bench.up()
    assert asked(bench, "at", command="AT+CNMP=38", force=True)["result"] == "OK"
    assert bench.modem.mode == 38


@pytest.mark.parametrize(
    ("do", "arguments"),
    [("fly", {}), ("at", {}), ("at", {"command": 7}), ("at", {"command": "hello"}), ("at", {"command": "AT\x1a"}),
     ("at", {"command": "AT", "force": "yes"})],
)  # fmt: skip
def test_what_is_no_question_is_refused(bench, do, arguments):
    bench.up()
    assert isinstance(asked(bench, do, **arguments), RequestError)


def test_the_status_is_what_status_shows(bench):
    bench.up()
    assert asked(bench, "status")["step"] == "up"


def test_a_reset_by_the_operator_is_no_failure(bench, loop):
    bench.up()
    assert asked(bench, "reset") == {"reset": "begun"}
    loop.run_until(lambda: not bench.station.is_up)
    loop.run_until(lambda: bench.modem.boots == 2)
    loop.run_until(lambda: bench.station.is_up, within=120)
    assert not bench.station.failures


def test_during_a_reset_there_is_nobody_to_ask(bench, loop):
    bench.up()
    asked(bench, "reset")
    loop.run_until(lambda: not bench.modem.is_plugged)
    loop.run_for(1)
    for do in ("at", "reset"):
        assert isinstance(asked(bench, do, command="AT"), RequestError)


def test_a_modem_that_does_not_return_from_a_reset_is_stuck(bench, loop):
    bench.up()
    bench.modem.boot_s = 1e6
    asked(bench, "reset")
    loop.run_until(lambda: bench.station.failures, within=200)
    assert isinstance(bench.station.failures[0], StuckError)
