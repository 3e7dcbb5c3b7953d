"""Received messages of the C++ client: values, components by path, errors, missed messages and other reports."""

import pytest

from tests.firmware.captain_client.cpp.double import Double
from tests.firmware.captain_client.cpp.driver import Driver

CONTAINER = {"speed": {"speedValue": 13.9}, "heading": {"headingValue": 90.0}}
MESSAGE = {"header": {"stationID": 4711}, "cam": {"high": CONTAINER, "path": [{"delta": 1}, {"delta": 2}]}}


@pytest.fixture
def listening(double: Double, driver: Driver) -> Driver:
    driver.ask("listen")
    double.wait_for_subscription("plain.")
    return driver


def test_message_has_its_value_and_its_reception(double: Double, listening: Driver) -> None:
    double.publish_plain(1, message=MESSAGE)
    assert listening.ask("next") == {
        "type": "cam", "station": 4711, "edition": "cam-1.4.1", "error": "", "pdu": [], "interface": "g5", "missed": 0,
        "received_ns": 1_795_182_426_461_613_000, "rssi_dbm": -71, "source": "02:00:00:00:00:0b", "value": MESSAGE,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("speedValue", 13.9),
        ("speed.speedValue", 13.9),
        ("cam.high.heading.headingValue", 90.0),
        ("header", {"stationID": 4711}),
        ("path.1.delta", 2),
    ],
)
def test_get_with_a_path_or_its_end_returns_the_component(
    double: Double, listening: Driver, path: str, value: object
) -> None:
    double.publish_plain(1, message=MESSAGE)
    listening.ask("next")
    assert listening.ask("get", path=path) == value


@pytest.mark.parametrize(
    ("path", "what"),
    [
        ("Value", "cam-1.4.1: Value: unknown or absent component"),
        ("", "cam-1.4.1: : unknown or absent component"),
        ("delta", "cam-1.4.1: delta: 2 components have this name; write more of the path, such as cam.path.0.delta"),
    ],
)
def test_get_of_no_component_or_several_is_an_error(double: Double, listening: Driver, path: str, what: str) -> None:
    double.publish_plain(1, message=MESSAGE)
    listening.ask("next")
    listening.tell("get", path=path)
    answer = listening.line()
    assert (answer["error"], answer["what"].startswith(what)) == ("error", True)


def test_message_that_does_not_decode_has_its_error_and_octets(double: Double, listening: Driver) -> None:
    double.publish_plain(1, error="truncated", pdu="020200001267ff")
    message = listening.ask("next")
    assert (message["error"], message["pdu"][:3], message["station"]) == ("truncated", [2, 2, 0], 4711)
    listening.tell("get", path="speedValue")
    assert "truncated" in listening.line()["what"]


def test_message_as_octets_has_its_station(double: Double, driver: Driver) -> None:
    driver.ask("listen", types=["cam", ""], form="pdu")
    double.wait_for_subscription("message..")
    said = {"run": "run-1", "sequence": 1, "type": "cam", "interface": "g5", "received_ns": 5, "rssi_dbm": None}
    double.publish("message.cam.", said, bytes.fromhex("020200001267ff"))
    message = driver.ask("next")
    assert (message["type"], message["station"], message["interface"]) == ("cam", 4711, "g5")
    assert (message["pdu"], message["rssi_dbm"], message["value"]) == ([2, 2, 0, 0, 0x12, 0x67, 0xFF], None, None)
    double.publish("message..", {**said, "sequence": 9}, b"\x63\x63")
    message = driver.ask("next")
    assert (message["type"], message["station"], message["missed"]) == ("", None, 0)


def test_gap_in_the_sequence_of_a_type_counts_missed_messages(double: Double, listening: Driver) -> None:
    for kind, sequence in (("cam", 17), ("cam", 18), ("denm", 4), ("cam", 21), ("cam", 20), ("denm", 6)):
        double.publish_plain(sequence, kind, message=MESSAGE)
    assert [listening.ask("next")["missed"] for _ in range(6)] == [0, 0, 0, 2, 0, 1]
    assert listening.ask("missed") == 3


def test_new_run_of_the_station_counts_missed_messages_from_its_start(double: Double, listening: Driver) -> None:
    double.publish_plain(17, message=MESSAGE)
    double.run = "run-2"
    double.publish_plain(3, message=MESSAGE)
    double.publish_plain(5, "denm", message=MESSAGE)
    assert [listening.ask("next")["missed"] for _ in range(3)] == [0, 2, 4]


def test_first_message_after_a_restart_counts_those_before_it(double: Double, listening: Driver) -> None:
    double.run = "run-2"
    double.publish_plain(40, message=MESSAGE)
    assert listening.ask("next")["missed"] == 39


@pytest.mark.parametrize(
    "frames",
    [(b"{",), (b"[]",), (b"\xff",), (b"",), (), (b"[" * 10_000,), (b"{}",), (b'{"reception":7}',),
     (b'{"reception":{"run":1,"sequence":-1,"rssi_dbm":"x"},"message":7,"pdu":"0g"}',)],
    ids=lambda frames: repr(frames[:1])[:60],
)  # fmt: skip
def test_invalid_report_does_not_end_the_client(double: Double, listening: Driver, frames: tuple[bytes, ...]) -> None:
    double.publish_octets(b"plain.cam.", *frames)
    for topic in (b"confirm.cam.", b"status."):
        double.publish_octets(topic, *frames)
    double.publish_plain(2, message=MESSAGE)
    stations = [listening.ask("next")["station"]]
    while stations[-1] != 4711:
        stations.append(listening.ask("next")["station"])
    assert len(stations) <= 2


def test_next_without_a_message_ends_after_its_timeout_and_at_a_signal(listening: Driver) -> None:
    assert listening.ask("next", timeout_ms=10) is None
    listening.tell("iterate", count=1)
    assert listening.interrupted() == {"said": []}


def test_range_of_messages_continues_after_a_restart(double: Double, listening: Driver) -> None:
    double.publish_plain(1, message=MESSAGE)
    listening.tell("iterate", count=2)
    double.stop()
    double.start_again("run-2")
    double.wait_for_subscription("plain.")
    double.publish_plain(1, "denm", message=MESSAGE)
    assert listening.line()["said"] == ["cam", "denm"]


def test_listener_outlives_its_station_and_is_replaced(double: Double, driver: Driver) -> None:
    driver.tell("listen_elsewhere", address=double.address)
    double.welcome()
    assert driver.line() == {"said": None}
    double.wait_for_subscription("plain.")
    double.publish_plain(1, message=MESSAGE)
    assert driver.ask("next")["station"] == 4711
    driver.ask("listen")
    double.wait_for_subscription("plain.")
    double.publish_plain(2, message=MESSAGE)
    assert driver.ask("next")["station"] == 4711


def test_reports_have_topic_object_and_third_frame(double: Double, driver: Driver) -> None:
    driver.ask("reports", topics=["frame.g5.", "time."])
    double.wait_for_subscription("time.")
    double.publish("frame.g5.", {"sequence": 1}, b"\1\2")
    assert driver.ask("report") == ["frame.g5.", {"sequence": 1}, [1, 2]]
    double.publish("time.", {"state": "locked"})
    assert driver.ask("report") == ["time.", {"state": "locked"}, []]


def test_status_is_the_next_one_and_a_moved_station_works(double: Double, driver: Driver) -> None:
    driver.tell("status")
    assert driver.line_after(double.publish_status)["said"]["station"] == "double"
    driver.ask("move")
    driver.ask("send", type="cam")
    assert double.take()[0] == b"v2x.cam."
