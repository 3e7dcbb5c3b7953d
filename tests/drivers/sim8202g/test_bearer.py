"""Bearers: programs and arguments that are run, and the parsing of their output."""

import pytest

from drivers.sim8202g.printed import Settings, mbim_settings, qmi_settings
from drivers.sim8202g.script import StepError
from drivers.sim8202g.system import Route
from tests.drivers.sim8202g.modem import FakeSystem
from tests.said import tells

PATIENCE_S = 0.0  # ptys tell when octets are on their way


# Output of qmicli 1.32 and mbimcli 1.28, by their sources.
QMI_START = """\
[/dev/cdc-wdm0] Network started
\tPacket data handle: '2264423824'
"""
QMI_CLIENT = """\
[/dev/cdc-wdm0] Client ID not released:
\tService: 'wds'
\t    CID: '18'
"""
QMI_SETTINGS = """\
[/dev/cdc-wdm0] Current settings retrieved:
           IP Family: IPv4
        IPv4 address: 10.64.1.2
    IPv4 subnet mask: 255.255.255.252
IPv4 gateway address: 10.64.1.1
    IPv4 primary DNS: 10.74.210.210
                 MTU: 1430
             Domains: none
"""
QMI_SETTINGS6 = """\
[/dev/cdc-wdm0] Current settings retrieved:
           IP Family: IPv6
        IPv6 address: 2001:db8:1:2:3:4:5:6/64
IPv6 gateway address: 2001:db8:1:2:3:4:5:7/64
                 MTU: 1500
"""
QMI_CONNECTED = "[/dev/cdc-wdm0] Connection status: 'connected'\n"
MBIM_CONNECT = """\
[/dev/cdc-wdm0] Successfully connected

[/dev/cdc-wdm0] Connection status:
\t      Session ID: '0'
\tActivation state: 'activated'

[/dev/cdc-wdm0] IPv4 configuration available: 'address, gateway, dns, mtu'
     IP [0]: '10.64.1.2/30'
    Gateway: '10.64.1.1'
    DNS [0]: '10.74.210.210'
        MTU: '1500'
"""


def qmi(make_modem, **options):
    bench = make_modem(bearer="qmi", **options)
    bench.system.printed = {
        "--wds-noop": QMI_CLIENT,
        "--wds-start-network": QMI_START,
        "--wds-get-current-settings": QMI_SETTINGS,
        "--wds-get-packet-service-status": QMI_CONNECTED,
    }
    return bench


QMICLI = "qmicli --device={dev}/cdc-wdm0 --device-open-proxy"


def with_device(bench, *lines):
    return [line.format(dev=bench.board.machine.dev) for line in lines]


def test_qmi_starts_the_network_and_configures_the_device_with_what_it_was_given(make_modem):
    bench = qmi(make_modem, apn="internet", metric=50)
    bench.up()
    assert bench.system.ran[:10] == with_device(
        bench,
        "ip link set dev wwan0 down",
        f"{QMICLI} --set-expected-data-format=raw-ip",
        "ip link set dev wwan0 up",
        f"{QMICLI} --wds-noop --client-no-release-cid",
        f"{QMICLI} --wds-start-network=apn='internet',ip-type=4 --client-cid=18 --client-no-release-cid",
        f"{QMICLI} --wds-get-current-settings --client-cid=18 --client-no-release-cid",
        "ip link set dev wwan0 up mtu 1430",
        "ip addr flush dev wwan0",
        "ip addr add 10.64.1.2/30 dev wwan0",
        "ip -4 route replace default via 10.64.1.1 dev wwan0 metric 50",
    )


def test_without_an_access_point_name_qmi_asks_for_the_networks_own(make_modem):
    bench = qmi(make_modem, ip_type="ipv6")
    bench.up()
    assert (
        f"{QMICLI} --wds-start-network=ip-type=6 --client-cid=18 --client-no-release-cid".format(
            dev=bench.board.machine.dev
        )
        in bench.system.ran
    )


def test_a_packet_service_that_the_network_ends_is_stopped_and_started_again(make_modem):
    bench = qmi(make_modem)
    bench.up()
    bench.loop.run_for(90)
    bench.system.printed["--wds-get-packet-service-status"] = QMI_CONNECTED.replace("connected", "disconnected")
    bench.loop.run_until(lambda: not bench.station.is_up)
    bench.system.printed["--wds-get-packet-service-status"] = QMI_CONNECTED
    before = len(bench.system.ran)
    bench.loop.run_until(lambda: bench.station.is_up)
    again = bench.system.ran[before - 1 :]
    stop = with_device(bench, f"{QMICLI} --wds-stop-network=2264423824 --client-cid=18")[0]
    assert stop in bench.system.ran
    assert any("--wds-start-network" in line for line in again)


STOP = f"{QMICLI} --wds-stop-network=2264423824 --client-cid=18"
RELEASE = "--wds-noop --client-cid=18"
HELD = '{"client": "18", "handle": "2264423824"}'


def test_a_network_that_does_not_start_leaves_no_client_behind(make_modem):
    bench = qmi(make_modem)
    bench.system.fails = {"--wds-start-network"}
    bench.start()
    bench.loop.run_until(lambda: any("next:" in why for why in bench.station.steps))
    bench.loop.run_for(3600)
    taken = sum(line.endswith("--wds-noop --client-no-release-cid") for line in bench.system.ran)
    released = sum(line.endswith(RELEASE) for line in bench.system.ran)
    assert taken > 10
    assert released >= taken - 1


def test_stopped_its_network_is_ended_and_its_address_taken_away(make_modem):
    bench = qmi(make_modem)
    bench.up()
    bench.system.ran.clear()
    bench.driver.stop()
    assert bench.system.ran == with_device(bench, STOP, "ip addr flush dev wwan0")


def test_a_network_that_a_station_left_without_a_word_is_ended_by_the_next_one(make_modem, tmp_path):
    record = tmp_path / "1-1.2-qmi.json"
    record.write_text(HELD)
    bench = qmi(make_modem)
    bench.up()
    assert bench.system.ran[0] == with_device(bench, STOP)[0]
    assert bench.system.ran[4].endswith("--wds-noop --client-no-release-cid")
    assert record.read_text() == HELD


@pytest.mark.parametrize("text", ["", "[]", "{", '{"client": "; reboot", "handle": ""}', '{"client": 1}'])
def test_a_record_of_a_network_that_is_none_is_left_alone(make_modem, tmp_path, text):
    (tmp_path / "1-1.2-qmi.json").write_text(text)
    bench = qmi(make_modem)
    bench.up()
    assert bench.system.ran[0] == "ip link set dev wwan0 down"


def test_a_network_that_cannot_be_written_down_is_a_network_all_the_same(make_modem, tmp_path):
    bench = qmi(make_modem, state_dir=str(tmp_path / "nowhere"))
    bench.up()


@pytest.mark.parametrize("bearer", ["rndis", "at"])
def test_the_route_of_a_lease_has_the_metric_that_is_configured(make_modem, bearer):
    bench = make_modem(bearer=bearer, metric=50)
    bench.modem.product = "9011" if bearer == "rndis" else "9001"
    device = "usb0" if bearer == "rndis" else "wwan0"
    bench.system.routes = [Route("10.64.1.1", 0)]
    bench.up()
    way = f"default via 10.64.1.1 dev {device} metric"
    replace = f"ip -4 route replace {way} 50"
    assert bench.system.ran[bench.system.ran.index(replace) + 1] == f"ip -4 route del {way} 0"
    bench.system.routes = [Route("10.64.1.1", 50)]
    bench.system.ran.clear()
    bench.loop.run_for(60)
    assert not any("ip -4 route" in line for line in bench.system.ran)


def test_a_context_that_is_active_is_not_activated_however_the_answer_is_spaced(make_modem):
    bench = make_modem()
    bench.modem.lies = lambda text: "\r\n+CGACT:1,1\r\n\r\nOK\r\n" if text == "AT+CGACT?" else None
    bench.start()
    bench.loop.run_until(lambda: "AT+CGPADDR=1" in bench.modem.asked)
    assert "AT+CGACT=1,1" not in bench.modem.asked


def test_mbim_attaches_connects_and_configures_the_device(make_modem):
    bench = make_modem(bearer="mbim", apn="internet")
    bench.modem.product = "901e"
    bench.system.printed = {"--connect": MBIM_CONNECT, "--query-connection-state": MBIM_CONNECT}
    bench.up()
    mbimcli = f"mbimcli --device={bench.board.machine.dev}/cdc-wdm0 --device-open-proxy"
    assert bench.system.ran[:6] == [
        f"{mbimcli} --attach-packet-service",
        f"{mbimcli} --connect=apn='internet',ip-type=ipv4",
        "ip link set dev wwan0 up mtu 1500",
        "ip addr flush dev wwan0",
        "ip addr add 10.64.1.2/30 dev wwan0",
        "ip -4 route replace default via 10.64.1.1 dev wwan0 metric 700",
    ]


def test_rndis_takes_an_address_by_dhcp_and_keeps_the_client(make_modem):
    bench = make_modem(bearer="rndis")
    bench.modem.product = "9011"
    bench.up()
    assert bench.system.ran[:2] == ["ip link set dev usb0 up", "udhcpc -f -n -t 10 -T 2 -i usb0"]
    assert bench.station.why == "usb0 has 192.168.225.34"


def test_a_call_by_at_speaks_raw_ip_on_the_device(make_modem):
    bench = make_modem(bearer="at")
    bench.up()
    assert "AT$QCRMCALL=1,1" in bench.modem.asked
    assert bench.system.ran[:4] == [
        "ip link set dev wwan0 down",
        f'sh -c echo Y > "$0" {bench.board.machine.sys}/class/net/wwan0/qmi/raw_ip',
        "ip link set dev wwan0 up",
        "udhcpc -f -n -t 10 -T 2 -i wwan0",
    ]


def test_device_without_an_address_is_no_link(make_modem):
    bench = make_modem(bearer="rndis")
    bench.modem.product = "9011"
    bench.up()
    bench.loop.run_for(90)
    bench.system.has = ()
    bench.loop.run_until(lambda: not bench.station.is_up, within=15)
    assert any(tells(step, "usb0 ", "no address") for step in bench.station.steps)
    bench.system.has = ("192.168.225.35",)
    bench.loop.run_until(lambda: bench.station.is_up)


def test_a_client_of_dhcp_that_ends_takes_the_link_down_and_is_started_again(make_modem):
    bench = make_modem(bearer="rndis")
    bench.modem.product = "9011"
    bench.up()
    bench.loop.run_for(90)
    bench.system.keeps = False
    bench.system.kept_ended()
    bench.loop.run_until(lambda: not bench.station.is_up, within=5)
    bench.loop.run_until(lambda: bench.station.is_up, within=10)
    assert sum(line.startswith("udhcpc") for line in bench.system.ran) == 2


def test_a_client_of_dhcp_that_nobody_answers_is_a_step_that_fails_and_is_tried_again(make_modem):
    bench = make_modem(bearer="rndis")
    bench.modem.product = "9011"
    bench.system.fails = {"udhcpc"}
    bench.start()
    bench.loop.run_until(
        lambda: "udhcpc ended with status 1 before the network had assigned an address" in bench.station.why
    )
    bench.system.fails = set()
    bench.loop.run_until(lambda: bench.station.is_up)


def test_a_program_that_is_missing_blocks_and_resets_nothing(make_modem, monkeypatch, tmp_path):
    bench = make_modem(bearer="qmi")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(bench.system, "run", super(FakeSystem, bench.system).run)
    bench.start()
    bench.loop.run_until(lambda: "ip is not installed; apt install iproute2" in bench.station.why)
    bench.loop.run_for(3600)
    assert bench.modem.boots == 1
    assert "AT+COPS=0" not in bench.modem.asked


def test_a_right_that_is_missing_blocks_and_resets_nothing(make_modem):
    bench = qmi(make_modem)
    bench.system.printed["link set"] = "RTNETLINK answers: Operation not permitted\n"
    bench.system.fails = {"link set"}
    bench.start()
    bench.loop.run_until(lambda: "ip is not permitted" in bench.station.why)
    bench.loop.run_for(3600)
    assert "CAP_NET_ADMIN" in bench.station.why
    assert bench.modem.boots == 1
    bench.system.fails = set()
    bench.loop.run_until(lambda: bench.station.is_up)


def test_program_that_fails_is_a_failed_step_with_its_last_words(make_modem):
    bench = qmi(make_modem)
    bench.system.printed["--wds-start-network"] = "error: couldn't start network: QMI protocol error (14): 'CallFailed'"
    bench.system.fails = {"--wds-start-network"}
    bench.start()
    bench.loop.run_until(lambda: any("next:" in why for why in bench.station.steps))
    assert tells(bench.station.why, "qmicli ", "status 1: error: couldn't start network")


def test_what_qmicli_prints_is_read():
    assert qmi_settings(QMI_SETTINGS) == Settings("10.64.1.2/30", "10.64.1.1", 1430)
    assert qmi_settings(QMI_SETTINGS6) == Settings("2001:db8:1:2:3:4:5:6/64", "", 1500)


def test_what_mbimcli_prints_is_read():
    assert mbim_settings(MBIM_CONNECT) == Settings("10.64.1.2/30", "10.64.1.1", 1500)


@pytest.mark.parametrize("printed", ["", "error: timeout", "IPv4 address: 10.64.1.2\nIPv4 subnet mask: 1.2.3.4"])
def test_what_another_version_may_print_is_said(printed):
    for settings in (qmi_settings, mbim_settings):
        with pytest.raises(StepError):
            settings(printed)
