"""Watch of the modem's link: old registrations, and packets without replies."""

from drivers.sim.modem.network import Access
from drivers.sim8202g.system import Counters, Route
from drivers.sim8202g.watch import FAILED_MOST, STALL_PACKETS, STALL_S, Stall

PATIENCE_S = 0.0  # ptys tell when octets are on their way
GATEWAY = "10.64.1.1"


# -- registration


def test_a_network_that_no_domain_speaks_of_any_more_is_no_link(make_modem):
    bench = make_modem()
    bench.up()
    bench.modem.lies = lambda text: "\r\nERROR\r\n" if "REG?" in text else None
    bench.loop.run_until(lambda: not bench.station.is_up, within=10 * (FAILED_MOST + 1))
    assert bench.station.details[-1]["registration"] == "unknown"


def test_a_look_that_failed_is_not_told_as_one_that_succeeded(make_modem):
    bench = make_modem()
    bench.up()
    bench.loop.run_for(5)
    bench.modem.lies = lambda text: "\r\nERROR\r\n" if "REG?" in text else None
    told = len(bench.station.details)
    bench.loop.run_for(15)
    assert len(bench.station.details) == told


def test_a_domain_that_refuses_once_is_asked_again(make_modem):
    bench = make_modem()
    bench.modem.network.offered = Access.LTE
    bench.up()
    left = ["\r\nERROR\r\n"]
    bench.modem.lies = lambda text: left.pop() if text == "AT+CEREG?" and left else None
    bench.loop.run_for(600)
    assert not left
    assert bench.modem.boots == 1
    assert bench.modem.asked[-20:].count("AT+CEREG?") > 1
    assert bench.station.is_up


def test_a_domain_that_the_firmware_does_not_have_is_asked_for_once(make_modem):
    bench = make_modem()
    bench.modem.network.offered = Access.LTE
    bench.modem.lies = lambda text: "\r\nERROR\r\n" if text == "AT+C5GREG?" else None
    bench.up()
    bench.loop.run_for(600)
    assert bench.modem.asked.count("AT+C5GREG?") == 1
    assert bench.station.is_up


# -- a stall


def test_a_silence_is_measured_from_the_first_packet_that_is_not_answered():
    stall = Stall()
    for now in range(0, 130, 10):
        assert not stall.is_stalled(now, Counters(5, 5))
    assert not stall.is_stalled(130, Counters(5, 5 + STALL_PACKETS))
    assert not stall.is_stalled(130 + STALL_S - 1, Counters(5, 6 + STALL_PACKETS))
    assert stall.is_stalled(130 + STALL_S, Counters(5, 7 + STALL_PACKETS))


def test_a_packet_that_comes_ends_a_silence():
    stall = Stall()
    stall.is_stalled(0, Counters(5, 5))
    stall.is_stalled(10, Counters(5, 50))
    assert not stall.is_stalled(10 + STALL_S, Counters(6, 90))
    assert not stall.is_stalled(11 + STALL_S, Counters(6, 190))


def up_by_call(make_modem):
    bench = make_modem(bearer="at")
    bench.system.printed = {"udhcpc": "lease of 10.64.1.2 obtained"}
    bench.system.routes = [Route(GATEWAY, 700)]
    bench.system.counts = Counters(100, 100)
    bench.up()
    return bench


def only_send(bench, seconds=400):
    for second in range(seconds):
        bench.system.counts = Counters(100, 100 + second)
        bench.loop.run_for(1)


def test_packets_that_only_go_out_are_a_stall_when_the_gateway_that_answered_does_not_any_more(make_modem):
    bench = up_by_call(make_modem)
    bench.loop.run_for(60)
    bench.system.fails = {"ping"}
    only_send(bench)
    assert any("none has come" in why for why in bench.station.steps)
    assert "AT+COPS=0" in bench.modem.asked


def test_a_station_that_only_sends_is_not_disturbed_while_the_gateway_answers(make_modem):
    bench = up_by_call(make_modem)
    only_send(bench, 1000)
    assert bench.station.is_up
    assert not any("none has come" in why for why in bench.station.steps)
    assert f"ping -c 2 -W 5 -I wwan0 {GATEWAY}" in bench.system.ran
    assert sum(line.startswith("ping") for line in bench.system.ran) < 20


def test_a_gateway_that_never_answered_an_echo_proves_nothing(make_modem):
    bench = make_modem(bearer="at")
    bench.system.fails = {"ping"}
    bench.system.printed = {"udhcpc": "lease of 10.64.1.2 obtained"}
    bench.system.routes = [Route(GATEWAY, 700)]
    bench.system.counts = Counters(100, 100)
    bench.up()
    only_send(bench, 1000)
    assert bench.station.is_up
    assert "AT+COPS=0" not in bench.modem.asked
