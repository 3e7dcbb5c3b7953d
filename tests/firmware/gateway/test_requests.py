"""Requests with options, and services, with doubles of ROS messages."""

import json
from types import SimpleNamespace
from typing import Any

import pytest

from firmware.gateway.captain_gateway.captain_gateway.channel import Channel
from firmware.gateway.captain_gateway.captain_gateway.codec import Edition
from firmware.gateway.captain_gateway.captain_gateway.counts import Complaints
from firmware.gateway.captain_gateway.captain_gateway.errors import RefusedError
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from firmware.gateway.captain_gateway.captain_gateway.requests import Requests, asked
from firmware.gateway.captain_gateway.captain_gateway.services import Services
from firmware.gateway.captain_gateway.captain_gateway.settings import HANDLER, receive, transmit
from firmware.routing.options import parse
from tests.firmware.gateway.library import HEAD, Library
from tests.firmware.gateway.real import CAM, DENM, real
from tests.said import tells


def request(area: dict[str, object] | None = None, **changed: object) -> SimpleNamespace:
    nowhere = {"shape": 0, "latitude": 0.0, "longitude": 0.0, "distance_a": 0, "distance_b": 0, "angle": 0}
    empty: dict[str, Any] = {
        "label": "", "type": "cam", "interfaces": [], "btp_port": 0, "traffic_class_is_present": False, "traffic_class": 0,
        "priority_is_present": False, "priority": 0, "lifetime": 0.0, "hop_limit": 0,
        "area": SimpleNamespace(**nowhere | (area or {})), "pdu": [], "cdr": [],
    }  # fmt: skip
    return SimpleNamespace(**empty | changed)


CIRCLE = {"shape": 1, "latitude": 47.0, "longitude": 15.0, "distance_a": 300}
RECTANGLE = {**CIRCLE, "shape": 2, "distance_b": 100, "angle": 45}


def test_nothing_is_asked_where_nothing_is_present():
    assert asked(request()) == {}


@pytest.mark.parametrize("area", [CIRCLE, RECTANGLE, {**RECTANGLE, "shape": 3}])
def test_what_is_asked_is_what_the_station_reads(area):
    made = asked(request(area, interfaces=["*"], btp_port=2001, priority_is_present=True, lifetime=2.5, hop_limit=3,
                         traffic_class_is_present=True, traffic_class=1))  # fmt: skip
    read = parse(json.dumps(made).encode())
    assert (read.options.priority, read.options.traffic_class, read.options.hop_limit) == (0, 1, 3)
    assert read.area is not None
    assert read.area.distance_a == 300


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (request(priority_is_present=True, priority=8), "priority: 8 is out of range; 0 to 7"),
        (request(label="x" * 257), "label: 257 characters; at most 256 are allowed"),
        (request(lifetime=-1.0), "lifetime: -1 is out of range"),
        (request(lifetime=float("nan")), "lifetime: nan"),
        (request(hop_limit=3), "hop_limit: 3 needs an area"),
        (request({**CIRCLE, "shape": 4}), "area.shape: 4 is out of range; 1 to 3"),
        (request({**CIRCLE, "latitude": 91.0}), "area.latitude: 91 is out of range; -90 to 90"),
        (request({**CIRCLE, "latitude": float("nan")}), "area.latitude: nan"),
        (request({**CIRCLE, "distance_a": 0}), "area.distance_a: 0 is out of range; 1 to 65535"),
        (request({**RECTANGLE, "distance_b": 0}), "area.distance_b: a rectangle of 0 m is empty"),
        (request({**RECTANGLE, "angle": 400}), "area.angle: 400 is out of range; 0 to 360"),
    ],
)
def test_what_cannot_be_meant_names_the_field_and_what_it_may_be(wrong, words):
    with pytest.raises(RefusedError) as refused:
        asked(wrong)
    assert words in str(refused.value)


DEFAULTS = {name: option.default for name, option in HANDLER.items()}
MESSAGES = SimpleNamespace(
    msg=SimpleNamespace(Confirm=None, Request=None), srv=SimpleNamespace(Encode=None, Decode=None)
)


def kind_of(edition: str) -> str:
    return edition.rpartition("-")[0].replace("-", "_")


class Node:
    """What Requests asks of the gateway: handlers with defaults, whose messages are kept."""

    def __init__(self, *editions: str) -> None:
        self.node = self
        self.sent: list[tuple[str, bytes, str]] = []
        self.complaints: list[str] = []
        self.channels = {kind_of(name): self._channel(name) for name in editions}

    def _channel(self, name: str) -> Channel:
        kind = KINDS[kind_of(name)]
        made = Channel(
            kind, Edition(Library(), name, "etsi_its", kind), receive(DEFAULTS), transmit(DEFAULTS),
            SimpleNamespace(place=None, leap_seconds=5), Complaints(60.0), self.complaints.append,
        )  # fmt: skip
        made.send = self._send
        return made

    def _send(self, channel: Channel, pdu: bytes, asked: dict[str, object], label: str) -> None:
        self.sent.append((channel.edition.name, pdu, label))

    def publisher(self, type_: object, topic: str) -> None: ...
    def create_service(self, type_: object, name: str, call: object) -> None: ...

    def subscription(self, type_: object, topic: str, call: Any) -> None:
        self.request = call

    def complain(self, about: str, cause: str, text: str) -> None:
        self.complaints.append(text)


@pytest.fixture
def node(services) -> Node:
    made = Node("cam-1.4.1", "denm-1.3.1")
    made.requests = Requests(made, MESSAGES, services)
    return made


@pytest.mark.parametrize("type_", ["", "cam", "cam-1.4.1", "cam_msgs/msg/CAM"])
def test_a_request_by_octets_is_handed_over_as_it_is(node, type_):
    node.request(request(type=type_, pdu=list(CAM), label="mine"))
    assert node.sent == [("cam-1.4.1", CAM, "mine")]
    assert node.complaints == []


def test_a_request_by_octets_alone_goes_to_the_edition_that_the_octets_are(services):
    node = Node("cpm-2.1.1", "cpm-tr-2.1.1")
    Requests(node, MESSAGES, services)
    cpm = real("cpm", 624)  # of protocolVersion 1, as the technical report has it
    node.request(request(type="", pdu=list(cpm)))
    assert node.sent == [("cpm-tr-2.1.1", cpm, "")], node.complaints


def test_a_request_by_a_serialised_message_is_handed_over_as_octets(node):
    node.request(request(cdr=list(HEAD + CAM)))
    assert node.sent == [("cam-1.4.1", CAM, "")]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (request(pdu=[2]), "1 octets are too short; the header alone has 6"),
        (request(pdu=list(CAM[:6])), "truncated"),
        (request(pdu=list(CAM[:30])), "bit 227: truncated"),
        (request(pdu=list(DENM)), "header.message_id: 1 is not that of cam"),
        (request(), "octet 0"),
        (request(cdr=[0]), "octet 0"),
        (request(type="", pdu=[2]), "neither type nor a message in pdu"),
        (request(type="", pdu=[2, 200, 0, 0, 0, 0]), "no handler has messageID 200"),
        (request(type="can", pdu=list(CAM)), "'can' is not one of cam, denm"),
        (request(pdu=list(CAM), priority_is_present=True, priority=8), "priority: 8"),
    ],
)
def test_a_request_that_cannot_be_meant_is_refused_in_words_and_counted(node, wrong, words):
    node.request(wrong)
    assert node.sent == []
    [said] = node.complaints
    assert words in said
    assert node.requests.diagnosis().values["refused"] == "1"


@pytest.fixture
def services() -> Services:
    library = Library()
    cam = Edition(library, "cam-1.4.1", "etsi_its", KINDS["cam"])
    return Services(library, "etsi_its", {"cam": SimpleNamespace(edition=cam)})


def answer(**more: Any) -> SimpleNamespace:
    return SimpleNamespace(
        success=False, reason="", edition="", type="", pdu=b"", cdr=b"", json="", left_out=[], **more
    )


def encoded(services: Services, **chosen: Any) -> SimpleNamespace:
    return services.encode(SimpleNamespace(**{"type": "cam", "cdr": b"", "json": ""} | chosen), answer())


def decoded(services: Services, pdu: bytes, type_: str = "") -> SimpleNamespace:
    return services.decode(SimpleNamespace(pdu=pdu, type=type_), answer())


def test_octets_are_decoded_by_their_header_and_encoded_again(services):
    found = decoded(services, CAM)
    assert (found.success, found.edition, found.cdr) == (True, "cam-1.4.1", HEAD + CAM)
    assert encoded(services, json=found.json).pdu == CAM
    assert encoded(services, cdr=found.cdr).pdu == CAM


def test_a_type_without_a_topic_is_decoded_as_well(services):
    assert decoded(services, DENM).edition == "denm-1.3.1"
    assert decoded(services, DENM, "denm-2.2.1").edition == "denm-2.2.1"


# CAM V1.3.2 of a made value, curvature 386; V1.4.1 reads -74.
VERSION_1 = bytes.fromhex("010200000001c41e005a97ac450dd00a399ffffffc23b7743e00d2afc14dfe3fe9ed0733b590303600")


def test_the_header_selects_the_edition_of_a_service(services):
    found = decoded(services, VERSION_1)
    assert (found.success, found.edition, found.reason) == (True, "cam-1.3.2", "")
    assert '"curvatureValue":386' in found.json
    assert encoded(services, type="cam-1.3.2", json=found.json).pdu == VERSION_1
    for refused in (decoded(services, VERSION_1, "cam"), encoded(services, json=found.json)):
        assert not refused.success
        assert "header.protocol_version: 1 selects cam-1.3.2, not cam-1.4.1" in refused.reason


def test_service_of_an_ambiguous_message_names_both_editions(services):
    vam = bytes.fromhex("031000001267ce004137480ef6c6b49d2000004dd1c2148d5b0006ea6afffb98031010")
    found = decoded(services, vam, "vam-2.3.1")
    assert found.success
    assert tells(found.reason, "warning: ", "ambiguous edition: ", "vam-2.3.1 and vam-2.1.1 ")


@pytest.mark.parametrize("name", ["cam", "cam-1.4.1", "cam_msgs/msg/CAM"])
def test_a_type_may_be_named_in_three_ways(services, name):
    assert encoded(services, type=name, cdr=HEAD + CAM).pdu == CAM


@pytest.mark.parametrize(
    ("pdu", "type_", "words"),
    [
        (b"", "", "0 octets are too short"),
        (CAM[:30], "", "bit 227"),
        (b"\2\xc8" + CAM[2:], "", "no message has messageID 200"),
        (CAM, "can", "type 'can' is neither"),
    ],
)
def test_what_does_not_decode_is_answered_with_why(services, pdu, type_, words):
    found = decoded(services, pdu, type_)
    assert not found.success
    assert words in found.reason


@pytest.mark.parametrize(
    "chosen", [{"cdr": b""}, {"cdr": HEAD + CAM[:30]}, {"json": "{"}, {"json": "{}"}, {"type": "can"}]
)
def test_what_cannot_be_encoded_is_answered_with_why(services, chosen):
    found = encoded(services, **chosen)
    assert not found.success
    assert found.reason
