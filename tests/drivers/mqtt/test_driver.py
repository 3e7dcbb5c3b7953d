"""MQTT driver: messages to its process, and reports to the station."""

import os
from types import SimpleNamespace

import pytest

import drivers.mqtt.uplink
from board.runtime.errors import BlockedError, InterfaceError
from drivers.contract import Borne, Can, Parting, Sent
from drivers.message import Ego, Position
from drivers.mqtt.client.settings import settings_in
from drivers.mqtt.driver import PART_S, Mqtt
from drivers.mqtt.options import MqttOptions
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.message import ReceivedPdu
from tests.drivers.fake_worker import FakeWorker
from tests.drivers.host import CAM, DENM, EGO, SHARED, requests
from tests.said import tells

URL = "mqtts://broker.example:8883"
NO_CA = "ca.pem holds no certificate", "take the broker's CA"  # a fault of the process: what, and the remedy


@pytest.fixture(autouse=True)
def _fake(monkeypatch):
    monkeypatch.setattr(drivers.mqtt.uplink, "Worker", FakeWorker)
    monkeypatch.setattr(FakeWorker, "made", [])


@pytest.fixture
def start(host):
    """Return a function that starts a driver whose process runs."""

    def start(runs=True, **options):
        driver = Mqtt(MqttOptions(url=URL, **options), SHARED._replace(types=("cam", "denm")))
        driver.start(host)
        worker = FakeWorker.made[-1]
        if runs:
            worker.run()
        return driver, worker

    return start


def is_down(host, *parts) -> bool:
    """Return True if the last report of the link is that it is down, with a reason that names these parts."""
    is_up, why = host.links[-1]
    return not is_up and tells(why, *parts)


# Messages to the process.


def test_the_process_is_told_all_that_options_say_before_anything_else(start):
    _, worker = start(
        client_id="vm", prefix="fleet", qos=0, version="3.1.1", keep_alive_s=7, clean=False, depths=(14, 18), device="eth0"
    )  # fmt: skip
    found = settings_in(worker.told[0])
    assert (found.url, found.profile, found.types, found.urgent) == (URL, "vcaptain", ("cam", "denm"), (1,))
    assert (found.client_id, found.host, found.prefix, found.qos, found.version) == ("vm", "vm", "fleet", 0, "3.1.1")
    assert (found.keep_alive_s, found.clean, found.depths, found.device) == (7, False, (14, 18), "eth0")
    assert not found.bearer


def test_what_options_leave_out_is_made_of_the_host_and_its_address(start):
    found = settings_in(start()[1].told[0])
    assert found.client_id == found.host == os.uname().nodename
    assert found.station == int.from_bytes(SHARED.mac[2:])
    assert len(found.uuid) == 36
    assert settings_in(start()[1].told[0]).uuid == found.uuid
    assert settings_in(start(client_id="another")[1].told[0]).uuid != found.uuid


def test_a_machine_whose_name_no_topic_can_hold_has_another_there(start, monkeypatch):
    monkeypatch.setattr(os, "uname", lambda: SimpleNamespace(nodename="my box/2#"))
    assert settings_in(start()[1].told[0]).client_id == "my-box-2-"


def test_a_session_that_is_kept_brings_nothing_that_is_old(start):
    # A message that the broker delivers late has no time of its own: its time of reception is that of the delivery.
    assert settings_in(start(clean=False)[1].told[0]).session_expiry_s <= 30


def test_a_host_of_its_own_is_not_the_client_id(start):
    found = settings_in(start(client_id="vm-7", host="vm")[1].told[0])
    assert (found.client_id, found.host) == ("vm-7", "vm")


def test_the_process_is_told_own_state_when_it_runs_and_again_when_it_is_another(start, host, loop):
    _, worker = start()
    assert [talk.parse_ego(message) for message in worker.take(talk.EGO)] == [EGO]
    loop.run_for(30)
    assert worker.take(talk.EGO) == []
    moved = EGO._replace(position=Position(EGO.position.latitude + 500, EGO.position.longitude))
    host.ego = lambda: moved
    loop.run_for(0.9)
    assert worker.take(talk.EGO) == []
    loop.run_for(0.2)
    assert [talk.parse_ego(message) for message in worker.take(talk.EGO)] == [moved]


def test_own_state_that_was_not_taken_is_told_again(start, host, loop):
    _, worker = start()
    worker.told.clear()
    moved = EGO._replace(speed=500)
    host.ego = lambda: moved
    worker.is_full = True
    loop.run_for(3)
    worker.is_full = False
    loop.run_for(1)
    assert [talk.parse_ego(message) for message in worker.take(talk.EGO)] == [moved]


def test_own_state_is_told_once_a_second_at_most(start, host, loop):
    _, worker = start()
    worker.told.clear()
    host.ego = lambda: EGO._replace(speed=int(loop.now * 1000))
    loop.run_for(10)
    assert len(worker.take(talk.EGO)) == 10


@pytest.mark.parametrize(
    ("now", "is_told"),
    [
        (EGO._replace(its_ms=EGO.its_ms + 60_000), False),
        (EGO._replace(position=Position(EGO.position.latitude, EGO.position.longitude - 1)), True),
        (EGO._replace(speed=EGO.speed + 1), True),
        (EGO._replace(heading=EGO.heading + 1), True),
        (EGO._replace(is_known=False), True),
        (EGO._replace(is_accurate=False), True),
    ],
)
def test_own_state_is_told_where_anything_but_its_time_differs(start, host, loop, now: Ego, is_told: bool):
    # Even a slow vehicle enters another tile after such a small move.
    _, worker = start()
    worker.told.clear()
    host.ego = lambda: now
    loop.run_for(5)
    assert [talk.parse_ego(message) for message in worker.take(talk.EGO)] == [now] * is_told


# Requests.


def test_a_request_is_handed_to_the_process_and_confirmed_when_that_says_so(start, host):
    driver, worker = start()
    (wanted,) = requests([CAM])
    assert driver.send(wanted) is Sent.LATER
    (message,) = worker.take(talk.SEND)
    assert talk.parse_send(message) == talk.ToSend(1, wanted.deadline, 2001, 0, CAM)
    worker.message(talk.sent(1))
    assert (host.confirms, host.confirm_details) == ([(wanted, None)], [""])


@pytest.mark.parametrize("reason", [Reason.SEND_FAILED, Reason.EXPIRED])
def test_what_the_broker_says_against_a_request_reaches_its_confirm(start, host, reason):
    driver, worker = start()
    (wanted,) = requests([DENM])
    driver.send(wanted)
    worker.message(talk.sent(1, reason, f"{URL}: Not authorized"))
    assert host.confirms == [(wanted, reason)]
    assert host.confirm_details == [f"{URL}: Not authorized"]


def test_no_more_are_taken_than_may_be_in_flight_and_the_next_one_when_one_is_acknowledged(start, host):
    driver, worker = start(max_in_flight=3)
    first, second, third, fourth = requests([CAM, DENM, CAM, DENM])
    assert [driver.send(one) for one in (first, second, third)] == [Sent.LATER] * 3
    assert host.times_writable == 0
    assert driver.send(fourth) is Sent.BUSY
    assert len(worker.take(talk.SEND)) == 3
    worker.message(talk.sent(2))
    assert host.times_writable == 1
    assert driver.send(fourth) is Sent.LATER
    worker.message(talk.sent(1))
    assert host.times_writable == 1  # no request waits


def test_a_request_that_the_process_cannot_be_given_waits_until_it_reads_again(start, host):
    driver, worker = start()
    worker.is_full = True
    (wanted,) = requests([CAM])
    assert driver.send(wanted) is Sent.BUSY
    worker.is_full = False
    worker.writable()
    assert host.times_writable == 1
    assert driver.send(wanted) is Sent.LATER


# Received messages.


def test_what_the_broker_delivers_is_indicated_with_its_port_and_source(start, host):
    _, worker = start()
    worker.message(talk.received(1_700_000_000_000_000_000, ReceivedPdu(CAM, 2001, "car-7")))
    worker.message(talk.received(1_700_000_000_000_000_001, ReceivedPdu(DENM, None, "")))
    assert host.pdus == [CAM, DENM]
    (_, first_ns, first), (_, _, second) = host.indications
    assert (first_ns, first.btp_port, first.source) == (1_700_000_000_000_000_000, 2001, "car-7")
    assert (second.btp_port, second.source) == (None, "")


def test_a_delivery_with_requests_is_a_request_with_its_port_and_no_indication(start, host):
    _, worker = start(requests=True)
    worker.message(talk.received(1, ReceivedPdu(CAM, 2001, "car-7")))
    worker.message(talk.received(2, ReceivedPdu(DENM, None, "")))
    assert (host.requests, host.pdus) == ([(CAM, 2001), (DENM, None)], [])


@pytest.mark.parametrize(
    ("place", "urls"),
    [
        ("broker.example:8883", ["mqtts://broker.example", "MQTTS://Broker.Example.:8883"]),
        ("localhost:1883", ["mqtt://localhost", "mqtt://127.0.0.1:1883", "mqtt://[::1]", "mqtt://[0:0:0::1]:1883"]),
        ("localhost:1884", ["mqtt://localhost:1884"]),
        ("2001:db8::1:8883", ["mqtts://[2001:db8::1]", "mqtts://[2001:0DB8:0::1]"]),
    ],
)
def test_broker_is_the_same_place_in_all_forms_of_its_url(place: str, urls: list[str]):
    assert {Mqtt(MqttOptions(url=url), SHARED).capabilities.broker for url in urls} == {place}


def test_drop_of_the_process_is_counted_by_its_reason_with_a_sample(start, host):
    _, worker = start()
    why = "text in brackets is not base64"
    worker.message(talk.dropped(Reason.PAYLOAD, 40, b"vm(2001): <%%%>", why))
    worker.message(talk.dropped(Reason.TOPIC, 1))
    assert (host.drops, host.samples) == ({Reason.PAYLOAD: 40, Reason.TOPIC: 1}, [b"vm(2001): <%%%>", b""])
    assert host.drop_details == [why, ""]


def test_its_link_is_what_the_process_says_once(start, host):
    _, worker = start()
    assert host.links == []
    for _ in range(2):
        worker.message(talk.state(False, f"{URL}: certificate has expired"))
    worker.message(talk.state(True, f"{URL}: connected"))
    assert host.links == [(False, f"{URL}: certificate has expired"), (True, f"{URL}: connected")]
    assert host.failures == []


def test_details_are_those_of_the_process_beside_the_drivers_own(start, host):
    _, worker = start(bearer="modem")
    worker.message(talk.details({"published": 7, "last_error": "no route"}))
    assert host.details[-1] == {
        "broker": URL, "profile": "vcaptain", "bearer": "modem", "published": 7, "restarts": 0, "last_error": "no route",
    }  # fmt: skip


# Failures.


def test_process_that_ends_fails_the_interface_and_the_next_start_makes_another(start, host):
    driver, worker = start()
    worker.state(False, "process 4711 was killed by SIGKILL; starts again in 0.2 s")
    (error,) = host.failures
    assert "MQTT client" in error.message
    assert error.message.endswith("SIGKILL")
    assert "4711" not in error.message
    assert worker.is_stopped
    driver.start(host)
    assert len(FakeWorker.made) == 2
    FakeWorker.made[1].message(talk.details({"published": 0, "last_error": ""}))
    assert (host.details[-1]["restarts"], host.details[-1]["last_error"]) == (1, host.failures[0].message)


def test_a_process_that_cannot_be_started_fails_the_start(host, monkeypatch):
    monkeypatch.setattr(FakeWorker, "starts", False)
    driver = Mqtt(MqttOptions(url=URL), SHARED)
    with pytest.raises(InterfaceError, match=r"Too many open files$"):
        driver.start(host)
    assert host.failures == []
    assert FakeWorker.made[0].is_stopped


def test_process_with_a_fault_of_its_files_is_not_started_again_until_a_file_changes(host, tmp_path):
    ca = tmp_path / "ca.pem"
    ca.write_text("rubbish")
    driver = Mqtt(MqttOptions(url=URL, ca=str(ca)), SHARED)
    driver.start(host)
    FakeWorker.made[0].run()
    FakeWorker.made[0].message(talk.fault(*NO_CA))
    (error,) = host.failures
    assert isinstance(error, BlockedError)
    assert (error.message, error.hint) == NO_CA
    for _ in range(3):
        with pytest.raises(BlockedError, match=NO_CA[0]):
            driver.start(host)
    assert len(FakeWorker.made) == 1
    ca.write_text("another rubbish")
    driver.start(host)
    assert len(FakeWorker.made) == 2


def test_file_that_is_renewed_while_the_process_reads_the_old_one_is_tried(host, tmp_path):
    ca = tmp_path / "ca.pem"
    ca.write_text("rubbish")
    driver = Mqtt(MqttOptions(url=URL, ca=str(ca)), SHARED)
    driver.start(host)
    FakeWorker.made[0].run()
    ca.write_text("a good one, just in time")
    FakeWorker.made[0].message(talk.fault(*NO_CA))
    driver.start(host)
    assert len(FakeWorker.made) == 2


def test_a_message_library_that_is_built_later_is_tried(host, tmp_path, monkeypatch):
    library = tmp_path / "captain_messages.so"
    monkeypatch.setattr(drivers.mqtt.options, "library_file", lambda: str(library))
    driver = Mqtt(MqttOptions(url=URL, profile="nap"), SHARED)
    driver.start(host)
    FakeWorker.made[0].run()
    FakeWorker.made[0].message(talk.fault("the message library cannot be imported", "`make codec` builds it"))
    with pytest.raises(BlockedError, match="message library"):
        driver.start(host)
    library.write_text("built")
    driver.start(host)
    assert len(FakeWorker.made) == 2


def test_stopped_it_tells_the_process_nothing_and_hears_of_no_bearer(start, host, loop):
    driver, worker = start(bearer="modem")
    driver.stop()
    worker.told.clear()
    driver.bearer_changed("up", "wwan0", "wwan0 has 10.0.0.7")
    loop.run_for(10)
    assert (worker.told, host.links, loop.delay()) == ([], [], None)


def test_its_good_bye_is_waited_for_a_moment_at_the_end_and_not_before(start, host):
    driver, worker = start()
    driver.stop()
    assert worker.told[-1] == talk.LEAVE_NOW
    assert worker.waited_s == 0.0
    driver.part()
    assert worker.waited_s == PART_S
    assert isinstance(driver, Parting)


def test_one_that_was_never_started_has_no_good_bye():
    Mqtt(MqttOptions(url=URL), SHARED).part()


# The bearer.


def test_it_follows_the_bearer_that_it_names_and_carries_no_network_itself(start):
    driver, worker = start(bearer="modem")
    assert isinstance(driver, Borne)
    assert driver.bearer == "modem"
    assert Can.BEARER not in driver.capabilities.can
    assert settings_in(worker.told[0]).bearer


def test_uplink_without_its_bearer_is_down_whatever_the_process_reports(start, host):
    driver, worker = start(bearer="modem")
    driver.bearer_changed("down", "", "no SIM")
    assert is_down(host, "bearer modem", "no SIM")
    worker.message(talk.state(False, f"{URL}: waits for its bearer"))
    assert len(host.links) == 1
    driver.bearer_changed("down", "", "registration denied")
    assert is_down(host, "bearer modem", "registration denied")
    assert {talk.parse_bearer(message)[0] for message in worker.take(talk.BEARER)} == {False}


def test_uplink_with_a_starting_bearer_is_starting_too(start, host):
    driver, worker = start(bearer="modem")
    driver.bearer_changed("starting", "", "registration")
    (why,) = host.bring_up
    assert tells(why, "bearer modem", "registration")
    worker.message(talk.state(False, f"{URL}: waits for its bearer", is_starting=True))
    assert len(host.links) == 1
    driver.bearer_changed("down", "", "registration")
    assert is_down(host, "bearer modem", "registration")
    assert len(host.bring_up) == 1


def test_uplink_whose_bearer_comes_up_reports_no_earlier_wait(start, host):
    driver, worker = start(bearer="modem")
    driver.bearer_changed("down", "", "no SIM")
    worker.message(talk.state(False, f"{URL}: waits for its bearer", is_starting=True))
    driver.bearer_changed("up", "wwan0", "wwan0 has 10.0.0.7")
    worker.message(talk.state(False, f"{URL}: connecting", is_starting=True))
    worker.message(talk.state(True, f"{URL}: connected"))
    (is_up, why), *later = host.links
    assert not is_up
    assert tells(why, "bearer modem", "no SIM")
    assert later == [(False, f"{URL}: connecting"), (True, f"{URL}: connected")]
    assert host.bring_up == [f"{URL}: connecting"]


def test_bearer_that_comes_up_or_has_another_address_is_told_at_once(start, host):
    driver, worker = start(bearer="modem")
    worker.told.clear()
    driver.bearer_changed("up", "wwan0", "wwan0 has 10.0.0.7")
    driver.bearer_changed("up", "wwan0", "wwan0 has 10.0.0.8")
    assert [talk.parse_bearer(message) for message in worker.take(talk.BEARER)] == [(True, "wwan0")] * 2
    worker.message(talk.state(True, f"{URL}: connected"))
    assert host.links[-1] == (True, f"{URL}: connected")
    driver.bearer_changed("down", "", "lost the network")
    assert is_down(host, "bearer modem", "lost the network")
    assert [talk.parse_bearer(message) for message in worker.take(talk.BEARER)] == [(False, "")]


def test_a_process_that_takes_nothing_is_told_of_its_bearer_when_it_takes_more(start):
    driver, worker = start(bearer="modem")
    worker.told.clear()
    worker.is_full = True
    driver.bearer_changed("up", "wwan0", "wwan0 has 10.0.0.7")
    driver.bearer_changed("up", "wwan1", "wwan1 has 10.0.0.8")
    worker.is_full = False
    worker.writable()
    worker.writable()
    assert [talk.parse_bearer(message) for message in worker.take(talk.BEARER)] == [(True, "wwan1")]


def test_what_its_bearer_was_before_the_process_ran_is_told_when_it_runs(start):
    driver, worker = start(runs=False, bearer="modem")
    driver.bearer_changed("up", "wwan0", "wwan0 has 10.0.0.7")
    assert worker.told == []
    worker.run()
    assert [talk.parse_bearer(message) for message in worker.take(talk.BEARER)] == [(True, "wwan0")]
