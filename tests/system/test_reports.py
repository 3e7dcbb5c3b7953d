"""Options on port 5557; on 5558, status once a second and confirms of each request."""

import hashlib
import json
import struct
import time
from typing import Any

import pytest
import zmq

from tests.system.air import HEADERS
from tests.system.conftest import Bench, Launcher
from tests.system.user import Reports, mark

CAM = bytes.fromhex("020200000539") + b"cam"
CONFIRM_KEYS = {
    "request", "label", "type", "station_id", "octets", "outcome", "interfaces", "interface",
    "reason", "meaning", "queue_us", "send_us", "time", "sequence", "digest", "accepted_ns", "quality",
}  # fmt: skip
STATUS_KEYS = {
    "station", "version", "profile", "pid", "boot", "configuration", "time", "uptime_s", "interfaces", "endpoint",
    "drops", "duplicates", "policy", "cpu_s", "memory_kb", "clock",
}  # fmt: skip
CLOCK_KEYS = {
    "monotonic", "state", "offset_ns", "uncertainty_ns", "error_ns", "jitter_ns", "frequency_ppb", "skew_ppb", "age_s", "its_ms",
    "leap", "receiver", "pulse", "refclock", "tracking", "missing",
}  # fmt: skip
INDICATION_KEYS = {
    "type", "station_id", "octets", "digest", "interface", "received_ns", "monotonic", "btp_port", "rssi_dbm", "source",
    "quality", "sequence",
}  # fmt: skip
INTERFACE_KEYS = {
    "driver", "technology", "state", "why", "since_s", "restarts", "neighbours",
    "received", "sent", "received_octets", "sent_octets", "queue",
}  # fmt: skip


@pytest.fixture(scope="module")
def shared_reports(shared_btp: Bench) -> Reports:
    return shared_btp.make_reports()


def test_status_comes_by_itself_and_says_what_is_promised(btp: Bench, shared_reports: Reports) -> None:
    topic, status = shared_reports.next("status.")
    assert topic == "status."
    assert set(status) >= STATUS_KEYS
    assert set(status["interfaces"]["g5"]) >= INTERFACE_KEYS
    assert set(status["interfaces"]["g5"]["queue"]) >= {"length", "capacity", "longest"}
    assert set(status["endpoint"]) >= {"requests", "accepted", "published", "raw", "slow_since"}
    assert (status["station"], status["profile"]) == ("captain", "standard")
    assert (status["interfaces"]["g5"]["driver"], status["interfaces"]["g5"]["state"]) == ("udp", "up")
    assert str(btp.air.station[1]) in status["interfaces"]["g5"]["why"]


def test_the_time_comes_once_a_second_and_says_what_is_promised(shared_reports: Reports) -> None:
    topic, clock = shared_reports.next("time.")
    assert topic == "time."
    assert set(clock) == CLOCK_KEYS
    assert clock["state"] in ("unknown", "system")  # the station has only udp interfaces
    assert (clock["pulse"], clock["receiver"]) == (None, "")
    # ITS time counts 5 leap seconds since 2004. The tolerance is less than one of them.
    assert abs(clock["its_ms"] / 1000 - (time.time() - 1_072_915_200 + 5)) < 0.5
    assert 0 <= time.monotonic() - clock["monotonic"] < 60.0
    assert clock["leap"]["seconds"] == 5


def test_an_indication_comes_for_each_message_with_the_quality_of_its_time(btp: Bench, shared_reports: Reports) -> None:
    btp.air.send(pdu := mark())
    said: dict[str, Any] = {}
    while said.get("digest") != hashlib.sha256(pdu).hexdigest()[:16]:
        topic, said = shared_reports.next("indication.")
        assert topic == f"indication.{said['type']}."
    assert set(said) == INDICATION_KEYS
    assert (said["type"], said["station_id"], said["octets"]) == ("cam", int.from_bytes(pdu[2:6], "big"), len(pdu))
    assert (said["interface"], said["btp_port"]) == ("g5", 2001)
    assert abs(said["received_ns"] / 1e9 - time.time()) < 60.0
    assert said["quality"]["state"] in ("unknown", "system")


@pytest.mark.parametrize(("endpoint", "place"), [("to_users", "endpoint"), ("report", "report")])
def test_a_subscriber_that_never_reads_is_told_of_with_its_first_loss(
    launch: Launcher, endpoint: str, place: str
) -> None:
    bench = launch("pdu")
    assert bench.station.status()[place]["slow_since"] is None
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    silent = context.socket(zmq.SUB)
    silent.linger, silent.rcvhwm, silent.rcvbuf = 0, 1, 4096
    silent.subscribe(b"confirm." if endpoint == "report" else b"v2x.")
    silent.connect(bench.station.address(endpoint))

    def is_slow(status: dict[str, Any]) -> bool:
        for _ in range(500):
            bench.user.push_pdu(b"v2x.cam.", CAM) if endpoint == "report" else bench.air.send(CAM + bytes(1000))
        return status[place]["slow_since"] is not None

    status = bench.station.until(is_slow)
    assert status[place]["slow_count"] == 1
    assert [row["where"] for row in status["drops"] if row["reason"] == "subscriber-slow"] == [endpoint]
    context.destroy(linger=0)


def test_the_control_socket_gives_the_same_status(btp: Bench) -> None:
    assert set(btp.station.status()) >= STATUS_KEYS


def test_a_request_is_confirmed_as_accepted_and_then_as_sent(btp: Bench, shared_reports: Reports) -> None:
    btp.user.push_pdu(b"v2x.", CAM, label="mine")
    accepted, sent = shared_reports.confirms_of("mine", 2)
    assert set(accepted) >= CONFIRM_KEYS
    assert set(sent) >= CONFIRM_KEYS
    assert (accepted["outcome"], accepted["interfaces"]) == ("accepted", ["g5"])
    assert (sent["outcome"], sent["interface"], sent["reason"]) == ("sent", "g5", None)
    assert accepted["request"] == sent["request"]
    assert (sent["type"], sent["station_id"], sent["octets"]) == ("cam", 1337, len(CAM))
    assert sent["queue_us"] >= 0
    assert sent["send_us"] > 0


def test_requests_by_5555_are_confirmed_without_a_label(btp: Bench, shared_reports: Reports) -> None:
    btp.user.send(b"v2x.", CAM)
    assert [each["outcome"] for each in shared_reports.confirms_of("", 2)] == ["accepted", "sent"]


def test_the_topic_of_a_confirm_names_the_type(btp: Bench, shared_reports: Reports) -> None:
    btp.user.push_pdu(b"v2x.denm.", CAM, label="topic")
    topics: list[str] = []
    while len(topics) < 2:
        topic, confirm = shared_reports.next("confirm.")
        topics += [topic] * (confirm["label"] == "topic")
    assert topics == ["confirm.denm.", "confirm.denm."]


@pytest.mark.parametrize(
    ("envelope", "pdu", "reason"),
    [
        (b"v2x.cam", CAM, "bad-envelope"),
        (b"v2x.", CAM[:5], "short-pdu"),
        (b"v2x.", b"", "empty-pdu"),
        (b"v2x.cam.", bytes(1501), "long-pdu"),
        (b"v2x.", b"\2\xff" + CAM, "unknown-type"),
    ],
)
def test_a_refusal_says_why(btp: Bench, shared_reports: Reports, envelope: bytes, pdu: bytes, reason: str) -> None:
    btp.user.push_pdu(envelope, pdu, label=reason)
    (refused,) = shared_reports.confirms_of(reason, 1)
    assert (refused["outcome"], refused["reason"]) == ("refused", reason)
    assert refused["meaning"]
    assert refused["interfaces"] == []


def test_nothing_but_the_four_topics_is_on_5558(btp: Bench, shared_reports: Reports) -> None:
    for _ in range(20):
        btp.user.push_pdu(b"v2x.", CAM)
        btp.air.send(CAM)
    for _ in range(40):
        topic, body = shared_reports.next("")
        assert topic in ("status.", "time.") or topic.startswith(("confirm.", "indication."))
        assert isinstance(body, dict)


BAD_OPTIONS: list[Any] = [
    b"",
    b"{",
    b"[]",
    b"null",
    b"7",
    b'"label"',
    b"\xff\xfe",
    b"[" * 3000,
    b'{"label": "a" "b"}',
    {"labels": "x"},
    {"label": 5},
    {"interfaces": "g5"},
    {"interfaces": [5]},
    {"btp_port": -1},
    {"btp_port": 65536},
    {"btp_port": "2001"},
    {"btp_port": True},
    {"traffic_class": 256},
    {"priority": 8},
    {"priority": 1.5},
    {"lifetime_s": -1},
    {"lifetime_s": "long"},
    {"hop_limit": 0},
    {"hop_limit": 256},
    {"area": {}},
    {"area": {"shape": "square", "latitude": 1, "longitude": 2, "distance_a": 3}},
    {"area": {"shape": "circle", "latitude": 91, "longitude": 2, "distance_a": 3}},
    {"area": {"shape": "circle", "latitude": 1, "longitude": 2, "distance_a": 65536}},
]


@pytest.mark.parametrize("options", BAD_OPTIONS, ids=range(len(BAD_OPTIONS)))
def test_options_that_cannot_be_meant_refuse_the_request(btp: Bench, shared_reports: Reports, options: Any) -> None:
    frame = options if isinstance(options, bytes) else json.dumps(options).encode()
    before = btp.station.drops().get(("pull", "bad-options"), 0)
    btp.user.push.send_multipart([b"v2x.cam.", CAM, frame])
    btp.user.push_pdu(b"v2x.cam.", sent := mark())
    assert btp.air.hear().pdu == sent
    assert btp.station.drops()["pull", "bad-options"] == before + 1
    while (confirm := shared_reports.next("confirm.")[1])["outcome"] != "refused":
        pass
    assert confirm["reason"] == "bad-options"


def test_the_user_may_choose_another_btp_port(btp: Bench) -> None:
    btp.user.push_pdu(b"v2x.cam.", CAM, btp_port=4711)
    assert btp.air.hear() == (4711, CAM)


def test_an_interface_that_does_not_exist_refuses_the_request(btp: Bench, shared_reports: Reports) -> None:
    btp.user.push_pdu(b"v2x.cam.", CAM, interfaces=["nosuch"], label="nosuch")
    (refused,) = shared_reports.confirms_of("nosuch", 1)
    assert (refused["outcome"], refused["reason"]) == ("refused", "no-interface")


def test_5555_does_not_read_a_third_frame_as_options(btp: Bench) -> None:
    btp.user.send(b"v2x.cam.", CAM, b'{"btp_port": 4711}')
    assert btp.air.hear() == (2001, CAM)


def test_the_user_chooses_among_interfaces(launch: Launcher) -> None:
    bench = launch(interfaces={"g5": "pdu", "lte": "pdu"})
    lte = bench.airs["lte"]
    bench.user.push_pdu(b"v2x.cam.", CAM + b"to lte", interfaces=["lte"])
    bench.user.push_pdu(b"v2x.cam.", CAM + b"to g5", interfaces=["g5"])
    bench.user.push_pdu(b"v2x.cam.", CAM + b"to both")
    assert [lte.hear().pdu, lte.hear().pdu] == [CAM + b"to lte", CAM + b"to both"]
    assert [bench.air.hear().pdu, bench.air.hear().pdu] == [CAM + b"to g5", CAM + b"to both"]


def _next_packet(bench: Bench) -> bytes:
    while (frame := bench.air.socket.recv(2048))[19] >> 4 == 1:
        pass
    return frame


def test_the_traffic_class_stands_in_the_common_header(ethernet: Bench) -> None:
    ethernet.user.push_pdu(b"v2x.cam.", CAM, traffic_class=3)
    assert _next_packet(ethernet)[20] == 3


@pytest.mark.parametrize(("shape", "subtype"), [("circle", 0), ("rectangle", 1), ("ellipse", 2)])
def test_an_area_makes_a_geobroadcast(ethernet: Bench, shape: str, subtype: int) -> None:
    area = {"shape": shape, "latitude": 48.5, "longitude": -11.25, "distance_a": 500, "angle": 0}
    if shape != "circle":
        area |= {"distance_b": 200, "angle": 45}
    ethernet.user.push_pdu(b"v2x.denm.", CAM, area=area, hop_limit=5)
    frame = _next_packet(ethernet)
    assert frame[19] == 0x40 | subtype  # EN 302 636-4-1, table 9: GeoBroadcast
    assert frame[17] == frame[24] == 5  # remaining and maximum hop limit
    # Extended header: sequence number 2, reserved 2, source 24, then latitude, longitude, a, b, angle, reserved.
    latitude, longitude, distance_a, distance_b, angle = struct.unpack(">iiHHH", frame[54:68])
    assert (latitude, longitude, distance_a) == (485000000, -112500000, 500)
    assert (distance_b, angle) == ((0, 0) if shape == "circle" else (200, 45))
    assert frame[70:72] == (2002).to_bytes(2, "big")
    assert frame[74:] == CAM
    assert HEADERS + 16 == 74


def test_geobroadcasts_count_on(ethernet: Bench) -> None:
    area = {"shape": "circle", "latitude": 48, "longitude": 11, "distance_a": 100}
    for _ in range(3):
        ethernet.user.push_pdu(b"v2x.denm.", CAM, area=area)
    numbers = [int.from_bytes(_next_packet(ethernet)[26:28], "big") for _ in range(3)]
    assert [(number - numbers[0]) & 0xFFFF for number in numbers] == [0, 1, 2]
