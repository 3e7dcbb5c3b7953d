"""Driver of the 5G modem with a simulated SIM8202G, in virtual time."""

import logging
import os
import random
from itertools import pairwise

import pytest

from board.runtime.describe import read
from board.runtime.errors import ConfigurationError, InterfaceError, StuckError
from drivers.contract import Can
from drivers.sim.modem.commands import ICCID, IMEI, IMSI
from drivers.sim.modem.network import ADDRESS, Access
from drivers.sim8202g.driver import Sim8202g
from drivers.sim8202g.options import ModemOptions
from drivers.sim8202g.step import BRING_UP
from tests.drivers.host import SHARED
from tests.said import tells

PATIENCE_S = 0.0  # ptys tell when octets are on their way


@pytest.fixture
def bench(make_modem):
    return make_modem()


# -- bring-up


def test_it_is_a_bearer_and_nothing_else(bench):
    assert bench.driver.capabilities.can == Can.BEARER
    assert bench.driver.capabilities.technology == "5g"


def test_it_comes_up_by_steps_that_can_be_seen(bench):
    bench.up()
    steps = [why.partition(":")[0] for why in bench.station.steps]
    assert list(dict.fromkeys(steps)) == [step.words for step in BRING_UP.values()]
    assert bench.station.why == ADDRESS
    assert not bench.station.failures


def test_its_details_say_what_the_module_is_and_where_it_is_served(bench, loop):
    bench.modem.network.offered = Access.NSA
    bench.up()
    loop.run_for(60)
    details = bench.station.details[-1]
    assert details["step"] == "up"
    assert details["model"] == "SIMCOM_SIM8202G-M2"
    assert details["firmware"] == "LE13B04SIM8202M44A-M2"
    assert details["usb"] == "1e0e:9001"
    assert details["operator"] == "CHN-CT"
    assert details["registration"] == "home"
    assert details["temperature_c"] == 38
    assert details["rssi_dbm"] == -73
    assert details["addresses"] == [ADDRESS]
    assert details["cell"]["access"] == "5g-nsa"
    assert details["cell"]["leg"]["strength"] == {"rsrp_dbm": -96.0, "rsrq_db": -12.0, "snr_db": 9.5}


def test_its_details_say_how_old_they_are_whenever_they_are_asked_for(make_modem, loop):
    bench = make_modem(poll_s=10.0)
    bench.up()
    loop.run_for(60)
    seen = []
    for _ in range(60):
        loop.run_for(1)
        bench.driver.refresh()
        seen.append(bench.station.details[-1]["age_s"])
    for what, most in (("registration", 11.0), ("cell", 11.0), ("module", 61.0)):
        ages = [age[what] for age in seen]
        assert 0.0 <= min(ages) < 3.0
        assert most - 5.0 < max(ages) <= most
        assert max(later - before for before, later in pairwise(ages)) <= 1.1


def test_readings_of_a_modem_that_lost_its_card_grow_old(bench, loop):
    bench.up()
    loop.run_for(30)
    bench.modem.card.is_there = False
    bench.modem.network.leave()
    loop.run_until(lambda: not bench.station.is_up)
    loop.run_for(300)
    bench.driver.refresh()
    assert bench.station.details[-1]["age_s"]["module"] > 250.0


def test_a_driver_that_was_stopped_leaves_no_readings_behind(bench, loop):
    bench.up()
    loop.run_for(30)
    bench.driver.stop()
    assert bench.station.details[-1]["step"] == "stopped"
    assert not {"age_s", "cell", "rssi_dbm", "temperature_c", "operator"} & set(bench.station.details[-1])


@pytest.mark.parametrize(("offered", "access"), [(Access.LTE, "lte"), (Access.NSA, "5g-nsa"), (Access.SA, "5g-sa")])
def test_it_follows_its_registration_up_to_what_the_air_offers(bench, loop, offered, access):
    bench.modem.network.offered = offered
    bench.up()
    loop.run_for(30)
    assert bench.station.details[-1]["cell"]["access"] == access
    assert bench.station.is_up


def test_a_card_that_is_busy_after_power_on_is_waited_for(bench):
    bench.up()
    assert "looks at the SIM: busy" in bench.station.steps
    assert bench.modem.asked.count("AT+CPIN?") > 1


def test_an_access_point_is_set_once_and_before_the_network_is_attached_to(make_modem):
    bench = make_modem(apn="internet.v2x", ip_type="ipv4v6")
    bench.up()
    assert bench.modem.context == ("IPV4V6", "internet.v2x")
    asked = bench.modem.asked
    assert asked.index('AT+CGDCONT=1,"IPV4V6","internet.v2x"') < asked.index("AT+CGATT?")
    bench.station.fail(InterfaceError("again"))
    bench.loop.run_until(lambda: bench.station.is_up)
    assert sum(text.startswith("AT+CGDCONT=") for text in asked) == 1


def test_the_network_mode_is_set_where_it_is_another(make_modem):
    bench = make_modem(network_mode="lte-nr5g")
    bench.up()
    assert bench.modem.mode == 109
    assert "AT+CNMP=109" in bench.modem.asked


def test_start_without_a_module_is_refused_and_may_be_repeated(bench, host):
    for _ in range(3):
        with pytest.raises(InterfaceError):
            bench.driver.start(host)
    assert host.links == []


def test_a_port_that_another_program_has_is_refused_and_named(make_modem, host, tmp_path):
    bench = make_modem()
    bench.up()
    other = Sim8202g(ModemOptions(port=bench.driver._modem.port.path, bearer="none"), SHARED)
    with pytest.raises(InterfaceError, match="in use by another program"):
        other.start(host)
    assert bench.station.is_up


def test_another_usb_composition_is_switched_to_and_its_return_is_waited_for(make_modem):
    bench = make_modem(bearer="rndis")
    bench.system.printed = {"udhcpc": "udhcpc: lease of 192.168.225.34 obtained"}
    bench.up(within=180)
    assert bench.modem.product == "9011"
    assert bench.modem.boots == 2
    assert not bench.station.failures
    assert bench.station.why == "usb0 has 192.168.225.34"


def test_a_composition_that_the_module_does_not_keep_blocks_with_a_remedy(make_modem, loop):
    bench = make_modem(bearer="mbim")
    bench.modem.lies = lambda text: "\r\nUSBID: 0X1E0E,0X9001\r\n\r\nOK\r\n" if text == "AT+CUSBCFG?" else None
    bench.start()
    loop.run_until(lambda: "keeps USB composition 1e0e:9001" in bench.station.why, within=300)
    boots = bench.modem.boots
    loop.run_for(600)
    assert bench.modem.boots == boots
    assert not bench.station.failures


# -- supervision and recovery


def test_lost_coverage_takes_the_link_down_and_its_return_brings_it_up_without_a_reset(bench, loop):
    bench.up()
    loop.run_for(90)
    bench.modem.network.offer(Access.NONE)
    loop.run_until(lambda: not bench.station.is_up, within=30)
    assert "network lost" in bench.station.links[-1][1] or "network lost" in " ".join(bench.station.steps)
    loop.run_for(60)
    bench.modem.network.offer(Access.NSA)
    loop.run_until(lambda: bench.station.is_up, within=30)
    assert bench.modem.boots == 1
    assert "AT+COPS=0" not in bench.modem.asked


def test_a_night_without_coverage_is_no_fault_and_the_morning_is_noticed(bench, loop):
    bench.up()
    loop.run_for(90)
    bench.modem.network.offer(Access.NONE)
    loop.run_for(2 * 3600)
    assert not bench.station.failures
    assert 2 <= bench.modem.boots <= 8
    bench.modem.network.offer(Access.LTE)
    loop.run_until(lambda: bench.station.is_up, within=240)


def test_a_modem_that_the_network_refuses_says_so(bench, loop):
    bench.modem.network.denies = True
    bench.start()
    loop.run_until(lambda: bench.station.why == "registers with the network: denied")


def test_bearer_that_does_not_come_is_recovered_by_stronger_and_stronger_means(bench, loop):
    bench.modem.lies = lambda text: "\r\n+CME ERROR: 148\r\n" if text == "AT+CGACT=1,1" else None
    bench.start()
    loop.run_until(lambda: bench.station.failures, within=900)
    asked = bench.modem.asked
    assert asked.index("AT+COPS=0") < asked.index("AT+CFUN=4") < asked.index("AT+CRESET")
    assert isinstance(bench.station.failures[0], StuckError)
    assert "power" in bench.station.failures[0].hint
    rungs = [why.partition("; next: ") for why in bench.station.steps if "next:" in why]
    assert {what for what, *_ in rungs} == {"AT+CGACT=1,1: +CME ERROR: 148"}
    assert [word in rung for word, (*_, rung) in zip(("register", "radio", "reset"), rungs, strict=True)] == [True] * 3


def test_a_bearer_that_is_gone_is_brought_up_again(make_modem, loop):
    bench = make_modem(bearer="none")
    bench.up()
    loop.run_for(90)
    bench.modem.network.is_context_up = False
    bench.modem.unsolicited("+CGEV: NW PDN DEACT 1")
    loop.run_until(lambda: not bench.station.is_up, within=5)
    loop.run_until(lambda: bench.station.is_up, within=10)
    assert "AT+COPS=0" not in bench.modem.asked


def test_a_modem_that_falls_silent_ends_with_a_wish_for_a_power_cycle(bench, loop):
    bench.up()
    loop.run_for(60)
    bench.modem.answers = False
    loop.run_until(lambda: bench.station.failures, within=180)
    assert isinstance(bench.station.failures[0], StuckError)
    bench.modem.answers = True
    bench.modem.supplied(False)
    bench.modem.supplied(True)
    loop.run_until(lambda: bench.station.is_up, within=200)


def test_a_modem_that_has_never_answered_is_stuck_and_says_of_what(bench, loop):
    bench.modem.answers = False
    bench.start()
    loop.run_until(lambda: bench.station.failures, within=100)
    assert isinstance(bench.station.failures[0], StuckError)
    assert bench.station.failures[0].message == "waits for its AT port: no answer to AT: not done within 90 s"


def test_a_module_that_crashes_is_a_failure_and_comes_back_by_itself(bench, loop):
    bench.up()
    bench.modem.crash()
    loop.run_until(lambda: bench.station.failures)
    assert len(bench.station.failures) == 1
    loop.run_until(lambda: bench.station.refused)  # while it boots
    loop.run_until(lambda: bench.station.is_up, within=120)
    assert len(bench.station.failures) == 1
    assert len({str(error) for error in bench.station.refused}) == 1


def test_heat_beyond_the_range_is_logged_once(bench, loop, caplog):
    bench.up()
    bench.modem.celsius = 75
    with caplog.at_level(logging.WARNING):
        loop.run_for(600)
    (record,) = caplog.records
    assert tells(record.message, "bench: 75 C; ", "-30 to 70 C")


def troubles(modem, chance):
    """Return the faults that a test may cause in a modem."""
    return [
        modem.crash,
        lambda: setattr(modem, "answers", False),
        lambda: setattr(modem, "answers", True),
        lambda: modem.network.offer(Access.NONE),
        lambda: modem.network.offer(chance.choice([Access.LTE, Access.NSA, Access.SA])),
        lambda: modem.say(chance.randbytes(chance.randrange(2000))),
        lambda: modem.say(b"\r\n+CEREG: 2\r\n" * chance.randrange(1000)),
        lambda: modem.network.leave(Access.SEARCHING),
        lambda: setattr(modem.network, "is_context_up", False),
        lambda: setattr(modem, "lies", lambda text: "\r\nERROR\r\n" if chance.random() < 0.3 else None),
        lambda: setattr(modem, "lies", lambda text: "\r\nOK\r\n" if chance.random() < 0.3 else None),
        lambda: setattr(modem, "lies", lambda text: "" if chance.random() < 0.3 else None),
        lambda: setattr(modem, "lies", lambda text: None),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_whatever_happens_in_half_an_hour_it_comes_back_when_it_is_over(bench, loop, seed):
    chance = random.Random(seed)
    station, modem = bench.station, bench.modem
    station.power_cycle = lambda: modem.supplied(True)
    bench.up()
    end = loop.now + 1800
    while loop.now < end:
        chance.choice(troubles(modem, chance))()
        loop.run_for(chance.uniform(1, 60))
    modem.answers, modem.lies = True, lambda text: None
    modem.network.offer(Access.NSA)
    loop.run_until(lambda: station.is_up, within=900)
    loop.run_for(60)
    assert station.is_up
    descriptors = len(os.listdir("/proc/self/fd"))
    modem.crash()
    loop.run_until(lambda: not station.is_up)
    loop.run_until(lambda: station.is_up, within=300)
    assert len(os.listdir("/proc/self/fd")) == descriptors


# -- garbage and unexpected answers


def test_a_storm_of_unsolicited_codes_makes_no_storm_of_questions(bench, loop):
    bench.up()
    before = len(bench.modem.asked)
    for _ in range(100):
        bench.modem.say(b"\r\n+CEREG: 1\r\n" * 100)
        loop.run_for(0.1)
    assert len(bench.modem.asked) - before < 100
    assert bench.station.is_up


def test_answers_that_come_late_confuse_nothing(bench, loop):
    bench.up()
    late = []

    def lie(text):
        if text == "AT+CSQ" and len(late) < 3:
            late.append(loop.after(7.0, lambda: bench.modem.say(b"\r\n+CSQ: 1,99\r\n\r\nOK\r\n")))
            return ""
        return None

    bench.modem.lies = lie
    loop.run_for(120)
    assert len(late) == 3
    assert bench.station.is_up
    assert bench.station.details[-1]["rssi_dbm"] == -73


def test_an_hour_of_garbage_costs_few_lines_and_little_work_and_is_recovered_from(bench, loop, caplog):
    bench.up()
    turns = 0
    turn = loop.turn

    def count():
        nonlocal turns
        turns += 1
        turn()

    loop.turn = count
    bench.modem.answers = False
    bench.modem.babble(b"\xfe\x01\r\ngarbage 867584030123456\r\n" * 4, 5.0)
    with caplog.at_level(logging.INFO):
        loop.run_for(3600)
    assert len(caplog.records) < 20
    assert IMEI not in caplog.text
    assert "867584030123456" not in caplog.text
    assert turns < 20_000
    assert len(bench.station.failures) < 60
    bench.modem.answers = True
    bench.modem.supplied(True)
    loop.run_until(lambda: bench.station.is_up, within=240)
    assert bench.station.details[-1]["garbage_octets"] > 10_000


def test_identifiers_are_in_no_line_of_the_journal_and_in_no_details(make_modem, loop, tmp_path, caplog):
    path = tmp_path / "pin"
    path.write_text("1234\n")
    path.chmod(0o600)
    bench = make_modem(pin_file=str(path))
    bench.modem.card.state = "SIM PIN"
    with caplog.at_level(logging.DEBUG):
        bench.up()
        bench.modem.unsolicited(f'+CLIP: "07712345678",129,{IMSI}')
        bench.modem.unsolicited(f"+ICCID: {ICCID}")
        for text in ("AT+CGSN", "AT+CIMI", "AT+CICCID", "ATI"):
            bench.driver.operate("at", {"command": text}, lambda answer: None)
        loop.run_for(60)
    shown = caplog.text + repr(bench.station.details) + repr(bench.station.links)
    for secret in (IMEI, IMSI, ICCID, "07712345678", '1234"', "'1234'"):
        assert secret not in shown


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("AT+CGMM", f"SIMCOM\r\nIMEI {IMEI}\r\n\r\nOK"),
        ("AT+CGMR", f"x{IMEI}y\r\n\r\nOK"),
        ("AT+CFUN?", f"+CFUN: {IMEI}x\r\n\r\nOK"),
        ("AT+CPSI?", f"+CPSI: face{IMEI}\r\n\r\nOK"),
        ("AT+CGPADDR=1", f'+CGPADDR: 1,"{IMSI}"\r\n\r\nOK'),
        ("AT+CGACT?", f"+CGACT: 1,0\r\n{IMSI}A\r\n\r\nOK"),
        ("AT+CGACT=1,1", f"+CME ERROR: {IMSI}A"),
    ],
)
def test_an_identifier_in_the_wrong_answer_is_shown_nowhere(bench, loop, caplog, command, said):
    bench.modem.network.is_context_up = False
    bench.modem.lies = lambda text: f"\r\n{said}\r\n" if text == command else None
    with caplog.at_level(logging.DEBUG):
        bench.start()
        loop.run_for(900)
    shown = caplog.text + repr(bench.station.details) + repr(bench.station.links) + repr(bench.station.failures)
    assert IMEI not in shown
    assert IMSI not in shown


# -- stopping


def test_it_may_be_stopped_in_every_step_and_leaves_nothing(make_modem, loop):
    bench = make_modem()
    bench.power()
    for seconds in (0.0, 0.5, 1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 30.0):
        bench.driver.start(bench.station)
        loop.run_for(seconds)
        bench.driver.stop()
        bench.driver.stop()
        said = len(bench.station.links)
        loop.run_for(30)
        assert len(bench.station.links) == said
    bench.close()
    loop.run_for(1000)
    assert loop.delay() is None


# -- options


@pytest.mark.parametrize(
    ("table", "why"),
    [
        ({}, "one of usb and port"),
        ({"usb": "1-1.2", "port": "/dev/ttyUSB2"}, "one of usb and port"),
        ({"usb": "slot 2"}, "not the place"),
        ({"port": "/dev/ttyUSB2"}, "needs a control port"),
        ({"port": "/dev/ttyUSB2", "bearer": "rndis"}, "needs device"),
        ({"usb": "1-1.2", "apn": 'a"b'}, "invalid access point name"),
        ({"usb": "1-1.2", "network_mode": "6g"}, "not a choice"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(table, why):
    with pytest.raises(ConfigurationError, match=why):
        read(ModemOptions, table, "captain.toml")
