"""Messages in JSON: sent and received without an encoder of the user's own, and a process that is killed meanwhile."""

import json
import os
import signal
from typing import Any

import pytest

from tests.system.conftest import Bench, Launcher
from tests.system.user import JOIN_MS, Reports, mark

CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")
POSITION = {"latitude": 48.7668, "longitude": 11.4321}


@pytest.fixture(scope="module")
def shared(launch_shared: Launcher) -> tuple[Bench, Reports]:
    """Return a station with a user who subscribes to JSON and has received some."""
    bench = launch_shared(station={"id": 4711, "position": POSITION})
    reports = bench.make_reports()
    reports.sub.subscribe(b"json.")
    while not hears_json(bench, reports):
        pass
    return bench, reports


@pytest.fixture
def bench(shared: tuple[Bench, Reports]) -> Bench:
    return shared[0].settled()


@pytest.fixture
def reports(shared: tuple[Bench, Reports]) -> Reports:
    """Return the subscriber, after the objects of earlier messages."""
    bench, reports = shared
    bench.air.send(last := mark())
    while reports.next("json.")[1].get("pdu") != last.hex():
        pass
    return reports


def hears_json(bench: Bench, reports: Reports) -> bool:
    """Send a message; return True if JSON arrives soon."""
    bench.air.send(mark())
    while reports.sub.poll(JOIN_MS):
        if reports.sub.recv_multipart()[0].startswith(b"json."):
            return True
    return False


def cam(**components: object) -> dict[str, Any]:
    """Return a CAM that names only its station type and these components of the high-frequency container."""
    container = {"basicVehicleContainerHighFrequency": {"driveDirection": "forward", **components}}
    parameters = {"basicContainer": {"stationType": 5}, "highFrequencyContainer": container}
    return {"edition": "cam-1.4.1", "message": {"cam": {"camParameters": parameters}}}


def push(bench: Bench, envelope: bytes, value: object, label: str, form: str = "json") -> None:
    bench.user.push_pdu(
        envelope, value if isinstance(value, bytes) else json.dumps(value).encode(), label=label, form=form
    )


def test_json_with_an_edition_leaves_as_the_octets_of_its_message(bench: Bench, reports: Reports) -> None:
    bench.air.send(CAM)
    _, said = reports.next("json.cam.")
    assert (said["edition"], said["reception"]["interface"]) == ("cam-1.4.1", "g5")
    push(bench, b"v2x.cam.", said, "back")
    accepted, sent = reports.confirms_of("back", 2)
    assert (accepted["outcome"], sent["outcome"]) == ("accepted", "sent")
    assert bench.air.hear().pdu == CAM


def test_json_without_header_time_and_confidences_is_completed_by_the_station(bench: Bench, reports: Reports) -> None:
    push(bench, b"v2x.", cam(speed={"speedValue": 1390}), "short")
    assert [one["outcome"] for one in reports.confirms_of("short", 2)] == ["accepted", "sent"]
    pdu = bench.air.hear().pdu
    assert int.from_bytes(pdu[2:6], "big") == 4711
    bench.air.send(pdu)
    message = reports.next("json.cam.")[1]["message"]["cam"]["camParameters"]
    place = message["basicContainer"]["referencePosition"]
    assert (place["latitude"], place["longitude"]) == (487668000, 114321000)
    container = message["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]
    assert container["speed"] == {"speedValue": 1390, "speedConfidence": 127}
    assert container["heading"]["headingValue"] == 3601


def test_json_with_several_faults_is_refused_with_all_of_them(bench: Bench, reports: Reports) -> None:
    value = cam(speed={"speedValue": 99_999}, heading={"headingValue": -1}, spede=1, driveDirection="up")
    del value["message"]["cam"]["camParameters"]["basicContainer"]["stationType"]
    push(bench, b"v2x.cam.", value, "wrong")
    (refused,) = reports.confirms_of("wrong", 1)
    assert (refused["reason"], refused["station_id"]) == ("bad-json", None)
    container = "cam.camParameters.highFrequencyContainer.basicVehicleContainerHighFrequency"
    assert {one["path"]: one["value"] for one in refused["invalid"]} == {
        "cam.camParameters.basicContainer.stationType": None,
        f"{container}.spede": 1,
        f"{container}.driveDirection": "up",
        f"{container}.speed.speedValue": 99_999,
        f"{container}.heading.headingValue": -1,
    }


@pytest.mark.parametrize(
    ("body", "path"),
    [
        (b"[" * 10_000, ""),
        (b"{", ""),
        (b"[]", ""),
        (b'"cam"', ""),
        (b"\xff\xfe", ""),
        (b'{"edition":"cam-9.9.9","message":{}}', "edition"),
        (b'{"edition":"cam-1.4.1","message":[]}', "message"),
        (b'{"edition":"cam-1.4.1","massage":{},"message":{}}', "massage"),
        (b'{"edition":"cam-1.4.1","message":{"cam":{"generationDeltaTime":NaN}}}', "message.cam.generationDeltaTime"),
        (b'{"edition":"cam-1.4.1","message":{"cam":{"a":1,"a":2}}}', "message.cam.a"),
        (b'{"edition":"cam-1.4.1","message":{"cam":{"a":"\\ud800"}}}', "message.cam.a"),
        (b'{"edition":"cam-1.4.1","message":{"cam":{"generationDeltaTime":' + b"9" * 400 + b"}}}", "cam.generationDeltaTime"),
        (b'{"edition":"denm-1.3.1","message":{}}', "edition"),
    ],
    ids=lambda one: repr(one[:60]),
)  # fmt: skip
def test_hostile_json_is_refused_with_its_path_and_the_next_request_is_sent(
    bench: Bench, reports: Reports, body: bytes, path: str
) -> None:
    push(bench, b"v2x.cam.", body, "hostile")
    (refused,) = reports.confirms_of("hostile", 1)
    assert refused["reason"] == "bad-json"
    assert path in {one["path"] for one in refused["invalid"]}, refused
    push(bench, b"v2x.cam.", cam(), "next")
    assert reports.confirms_of("next", 2)[-1]["outcome"] == "sent"


def test_json_above_60_kib_is_refused_with_its_length(bench: Bench, reports: Reports) -> None:
    push(bench, b"v2x.cam.", b" " * 61_441, "long")
    (refused,) = reports.confirms_of("long", 1)
    assert (refused["reason"], "61441" in refused["detail"]) == ("bad-json", True)


def test_received_message_that_does_not_decode_is_published_with_its_error(bench: Bench, reports: Reports) -> None:
    bench.air.send(CAM[:20])
    _, said = reports.next("json.cam.")
    assert said["pdu"] == CAM[:20].hex()
    assert said["error"]
    assert "message" not in said


def test_subscription_to_everything_does_not_request_json(launch: Launcher) -> None:
    bench = launch()
    bench.make_reports()
    bench.air.send(CAM)
    assert bench.user.receive().pdu == CAM
    assert "facilities" not in bench.station.status()


def test_process_killed_beside_requests_is_restarted_and_each_request_has_one_outcome(launch: Launcher) -> None:
    bench = launch(station={"position": POSITION})
    reports = bench.make_reports()
    outcomes: dict[str, str] = {}
    killed: list[int] = []
    for number in range(100):
        push(bench, b"v2x.cam.", cam(speed={"speedValue": number}), str(number))
        if number % 50 == 25:
            killed.append(facilities_of(bench, killed))
            os.kill(killed[-1], signal.SIGKILL)
    while len(outcomes) < 100:
        confirm = reports.next()[1]
        if confirm["outcome"] != "accepted" and confirm["label"].isdecimal():
            assert confirm["label"] not in outcomes
            outcomes[confirm["label"]] = confirm["reason"] or confirm["outcome"]
    assert set(outcomes.values()) <= {"sent", "facilities-restarting"}
    sent = sum(outcome == "sent" for outcome in outcomes.values())
    assert sent >= 80
    assert len({bench.air.hear().pdu for _ in range(sent)}) == sent


def facilities_of(bench: Bench, killed: list[int]) -> int:
    """Return the process id of the running facilities process; killed: those that ended before."""

    def pid(status: dict[str, Any]) -> int:
        said = status.get("facilities", {"is_running": False})
        return int(said["why"].split()[1]) if said["is_running"] else 0

    return pid(bench.station.until(lambda status: pid(status) not in (0, *killed)))


def test_plain_json_is_encoded_and_published_in_si_units(bench: Bench, reports: Reports) -> None:
    reports.sub.subscribe(b"plain.")
    push(bench, b"v2x.cam.", cam(speed={"speedValue": 13.9}, vehicleLength={"vehicleLengthValue": 4.5}), "si", "plain")
    assert [one["outcome"] for one in reports.confirms_of("si", 2)] == ["accepted", "sent"]
    pdu = bench.air.hear().pdu
    said: dict[str, Any] = {}
    while not said:
        bench.air.send(pdu)
        reports.next("json.cam.")
        said = next_plain(reports)
    reports.sub.unsubscribe(b"plain.")
    parameters = said["message"]["cam"]["camParameters"]
    assert parameters["basicContainer"]["referencePosition"]["latitude"] == POSITION["latitude"]
    container = parameters["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]
    assert container["speed"] == {"speedValue": 13.9, "speedConfidence": "unavailable"}
    assert container["vehicleLength"]["vehicleLengthValue"] == 4.5


def next_plain(reports: Reports) -> dict[str, Any]:
    """Return the object of `plain.` that arrives soon; empty if none does."""
    while reports.sub.poll(JOIN_MS):
        topic, body = reports.sub.recv_multipart()
        if topic == b"plain.cam.":
            found: dict[str, Any] = json.loads(body)
            return found
    return {}


@pytest.mark.parametrize(
    ("component", "value"),
    [("speedValue", 163.83), ("speedValue", "fast"), ("speedValue", -0.1), ("speedConfidence", 1e999)],
)
def test_plain_json_out_of_range_is_refused_with_the_range(
    bench: Bench, reports: Reports, component: str, value: object
) -> None:
    push(bench, b"v2x.cam.", cam(speed={"speedValue": 13.9, component: value}), "bad", "plain")
    (refused,) = reports.confirms_of("bad", 1)
    (fault,) = refused["invalid"]
    assert fault["path"].endswith(f"speed.{component}")
    assert fault["problem"]


def test_plain_object_of_the_station_is_sent_back_by_its_own_form(bench: Bench, reports: Reports) -> None:
    push(bench, b"v2x.", cam(speed={"speedValue": 13.9}) | {"form": "plain"}, "form")
    assert [one["outcome"] for one in reports.confirms_of("form", 2)] == ["accepted", "sent"]
    push(bench, b"v2x.", cam() | {"form": "xml"}, "xml")
    (refused,) = reports.confirms_of("xml", 1)
    assert [one["path"] for one in refused["invalid"]] == ["form"]
