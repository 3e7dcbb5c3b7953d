"""Requests of the C++ client: frames on the wire, confirms, refusals, timeouts and restarts."""

import json
import time
from pathlib import Path

import pytest

from tests.firmware.captain_client.cpp.double import Double
from tests.firmware.captain_client.cpp.driver import Driver
from tests.system.ports import Ports

SETTLED_MS = 500  # libzmq connects again after at most 200 ms


def test_send_of_fields_writes_edition_fields_and_options(double: Double, driver: Driver) -> None:
    label = driver.ask("send", type="cam-1.4.1", fields={"speed": 13.9}, options={"lifetime_s": 2.0})
    envelope, body, options = double.take()
    assert (envelope, json.loads(body)) == (b"v2x.cam.", {"edition": "cam-1.4.1", "fields": {"speed": 13.9}})
    assert options == {"form": "plain", "label": label, "lifetime_s": 2.0}


def test_send_of_fields_in_braces_writes_objects(double: Double, driver: Driver) -> None:
    label = driver.ask("send_braces", type="cam")
    _, body, options = double.take()
    assert json.loads(body)["fields"] == {"speed": 13.9}
    assert options == {"form": "plain", "label": label, "lifetime_s": 2.0, "interfaces": ["g5"]}


@pytest.mark.parametrize("form", ["plain", "json"])
def test_send_message_writes_its_form(double: Double, driver: Driver, form: str) -> None:
    driver.ask("send_message", type="cam", message={"cam": {}}, form=form)
    _, body, options = double.take()
    assert (json.loads(body), options["form"]) == ({"edition": "cam", "message": {"cam": {}}}, form)


def test_send_pdu_writes_its_octets(double: Double, driver: Driver) -> None:
    label = driver.ask("send_pdu", type="denm", pdu=[2, 1, 0])
    assert double.take() == (b"v2x.denm.", b"\2\1\0", {"label": label})
    driver.ask("send_pdu", type="", pdu=[2, 1, 0])
    assert double.take()[0] == b"v2x."


@pytest.mark.parametrize("request_", [{"fields": {"speed": "x" * 65_536}}, {"options": {"interfaces": ["x" * 65_536]}}])
def test_frame_that_is_too_long_is_an_error(double: Double, driver: Driver, request_: dict[str, object]) -> None:
    driver.tell("send", type="cam", **request_)
    answer = driver.line()
    assert (answer["error"], "too long; the limit is 65535" in answer["what"]) == ("error", True)
    driver.ask("send", type="cam")
    assert double.take()[0] == b"v2x.cam."


def test_program_that_sends_and_ends_at_once_loses_nothing(program: Path, double: Double) -> None:
    driver = Driver(program, double.address)
    double.welcome()
    assert driver.line() == {"said": "connected"}
    for number in range(100):
        driver.tell("send", type="cam", fields={"speed": number})
    driver.close()
    assert [json.loads(double.take()[1])["fields"]["speed"] for _ in range(100)] == list(range(100))


def test_confirmed_waits_for_each_interface(double: Double, driver: Driver) -> None:
    label = driver.ask("send", type="cam")
    double.confirm("another user's", "refused", reason="bad-json")
    double.confirm(label, "accepted", interfaces=["g5", "v2n"])
    double.confirm(label, "sent", interface="g5")
    assert driver_times_out(driver)
    double.confirm(label, "dropped", interface="v2n", reason="link-down", meaning="the link was down")
    assert driver.ask("confirmed") == {"sent": ["g5"], "dropped": [["v2n", "link-down"]]}
    assert driver.ask("confirmed") == {"sent": ["g5"], "dropped": [["v2n", "link-down"]]}


def driver_times_out(driver: Driver) -> bool:
    driver.tell("confirmed", timeout_ms=100)
    answer = driver.line()
    return bool(answer["error"] == "unconfirmed" and "cam: not confirmed within 100 ms" in answer["what"])


def test_confirmed_of_a_message_that_every_interface_drops_is_refused(double: Double, driver: Driver) -> None:
    label = driver.ask("send", type="cam")
    double.confirm(label, "accepted", interfaces=["g5"])
    double.confirm(label, "dropped", interface="g5", reason="expired", meaning="it waited too long", detail="2 s")
    driver.tell("confirmed")
    answer = driver.line()
    assert (answer["error"], answer["reason"], answer["detail"]) == ("refused", "expired", "2 s")
    assert answer["what"] == "cam: dropped by g5: expired: 2 s; it waited too long"


def test_confirmed_of_invalid_fields_names_three_and_has_all(double: Double, driver: Driver) -> None:
    label = driver.ask("send", type="cam", fields={"spede": 1})
    faults = [{"path": f"p{number}", "problem": "unknown field", "value": number} for number in range(5)]
    double.confirm(label, "refused", reason="bad-json", meaning="not the JSON of a message", invalid=faults)
    driver.tell("confirmed")
    answer = driver.line()
    assert answer["invalid"] == [[fault["path"], fault["problem"], fault["value"]] for fault in faults]
    assert answer["what"] == (
        "cam: refused: bad-json; p0: unknown field; p1: unknown field; p2: unknown field; and 2 more; "
        "not the JSON of a message"
    )


def test_confirmed_after_a_restart_ends_at_once_and_the_next_request_is_confirmed(
    double: Double, driver: Driver
) -> None:
    driver.ask("send", type="cam")
    double.take()
    driver.tell("confirmed")
    double.stop()
    double.start_again("run-2")
    double.welcome()
    answer = driver.line()
    assert (answer["error"], "the station was restarted" in answer["what"]) == ("unconfirmed", True)
    driver.tell("send", type="cam")
    assert double.takes_nothing(SETTLED_MS)  # a status must show first that the station has the subscriptions
    label = driver.line_after(double.publish_status)["said"]
    double.confirm(label, "accepted", interfaces=["g5"])
    double.confirm(label, "sent", interface="g5")
    assert driver.ask("confirmed")["sent"] == ["g5"]


def test_status_that_comes_before_the_connection_for_messages_proves_nothing(double: Double, driver: Driver) -> None:
    double.stop_taking()
    time.sleep(SETTLED_MS / 1000)  # the client sees the end of the connection
    driver.tell("send", type="cam")
    time.sleep(SETTLED_MS / 1000)  # it waits for the next one
    double.publish_status()
    double.take_again()
    assert double.takes_nothing(SETTLED_MS)
    assert driver.line_after(double.publish_status)["said"] == double.take()[2]["label"]


def test_request_after_the_restart_stays_open_at_the_first_status_of_the_new_run(
    double: Double, driver: Driver
) -> None:
    label = driver.ask("send", type="cam")
    double.run = "run-2"
    double.publish_status(uptime_s=3600.0)
    double.confirm(label, "accepted", interfaces=["g5"])
    double.confirm(label, "sent", interface="g5")
    assert driver.ask("confirmed")["sent"] == ["g5"]


def test_confirmed_that_a_signal_interrupts_is_unconfirmed(double: Double, driver: Driver) -> None:
    driver.ask("send", type="cam")
    driver.tell("confirmed")
    assert driver.interrupted()["error"] == "unconfirmed"


def test_send_while_the_station_is_down_is_unreachable(program: Path, double: Double) -> None:
    driver = Driver(program, double.address, timeout_ms=200)
    double.welcome()
    assert driver.line() == {"said": "connected"}
    double.stop()
    errors = []
    while "unreachable" not in errors:  # the client has not seen the end of the connection yet
        driver.tell("send", type="cam")
        errors.append(driver.line().get("error"))
    driver.close()


def test_send_of_64_kib_is_an_error_and_the_connection_stays(double: Double, driver: Driver) -> None:
    driver.tell("send", type="cam", fields={"x": "y" * 65_536})
    assert driver.line()["error"] == "error"
    driver.ask("send", type="cam")
    assert double.take()[0] == b"v2x.cam."


@pytest.mark.parametrize("name", ["label", "form"])
def test_send_with_an_option_of_the_client_is_an_error(driver: Driver, name: str) -> None:
    driver.tell("send", type="cam", options={name: "x"})
    assert driver.line()["what"] == f"options: {name}: set by the client; leave it out"


def test_station_without_an_answer_is_unreachable_within_its_timeout(program: Path) -> None:
    ports = Ports()
    driver = Driver(program, f":{ports.take_row(4)[0]}", timeout_ms=100)
    assert driver.line()["error"] == "unreachable"
    driver.close()
    ports.release()


@pytest.mark.parametrize(
    "address",
    ["5555", "tcp://127.0.0.1:5555", "host:", "host:x", "host:0", "host:65533", "host:555555", "[::1", "[]:5", "a b"],
)
def test_station_with_an_invalid_address_names_it(program: Path, address: str) -> None:
    driver = Driver(program, address)
    answer = driver.line()
    assert (answer["error"], f'station: "{address}": ' in answer["what"]) == ("invalid", True)
    driver.close()
