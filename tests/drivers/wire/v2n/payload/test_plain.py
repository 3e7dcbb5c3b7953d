"""Forms of payloads: written and read ones, and refusals with their reason."""

import base64
import json
from collections.abc import Callable
from typing import Any

import captain_messages
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from board.runtime.errors import RequestError
from drivers.mqtt.profile import load
from drivers.reason import Reason
from drivers.wire.v2n.message import Sending
from drivers.wire.v2n.payload.json_values import MAX_DEPTH, read_object
from drivers.wire.v2n.payload.orange import envelope
from drivers.wire.v2n.payload.plain import Base64, VCaptain
from drivers.wire.v2n.profile import Delivery, ReceivedPdu, RefusedError
from firmware.topics import ROWS
from tests.drivers.wire.v2n.payload.orange import schema
from tests.drivers.wire.v2n.station import AS_JSON, HERE, NOW_MS, PDU, WITHOUT_FORM, delivered, in_envelope, profile

NAMED = sorted({row.name for row in ROWS})
AS_OCTETS = sorted({*NAMED} - {*AS_JSON, *WITHOUT_FORM})  # types that cannot be decoded
OUT = "5GCroCo/outQueue/v2x/cam/com_car_2/1/2/0/2"
SENT = Sending("cam", 2001, PDU, HERE, NOW_MS)


def refused(read: Callable[[], object], says: str) -> None:
    with pytest.raises(RefusedError, match=says) as error:
        read()
    assert error.value.reason is Reason.PAYLOAD


@pytest.mark.parametrize(
    ("payload", "pdu", "source"),
    [
        (b"vm(2001): <AgIAAAU5AAECAw==>", PDU, "vm"),
        (b"<AgIAAAU5AAECAw==>", PDU, ""),
        (b"anything > at all <AgIAAAU5AAECAw==> and more > of < it", PDU, ""),
        (b"a(b)(2001): <AgIAAAU5AAECAw==>", PDU, "a(b)"),
        (b"\xff(1): <AgIAAAU5AAECAw==>", PDU, ""),
        (b"\x07(1): <AgIAAAU5AAECAw==>", PDU, ""),
        (b"x" * 256 + b"(1): <AgIAAAU5AAECAw==>", PDU, ""),
        ("Grüße(1): <AgIAAAU5AAECAw==>".encode(), PDU, "Grüße"),
    ],
)
def test_the_text_between_the_first_brackets_is_the_pdu(payload: bytes, pdu: bytes, source: str):
    assert VCaptain("me").read("", payload) == (pdu, source)


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        (b"", "the payload has no <"),
        (b"vm(2001): AgIAAAU5AAECAw==", "the payload has no <"),
        (b"vm(2001): <AgIAAAU5AAECAw==", "the payload has no >"),
        (b"vm(2001): >AgIAAAU5AAECAw==<", "the payload has no >"),
        (b"a <<AgIAAAU5AAECAw==>", "not base64"),
        (b"a <AgIAAAU5AAECAw=>", "not base64"),
        (b"a <AgIAAAU5AAECAw>", "not base64"),
        (b"a <AgIAAAU5AAECAw===>", "not base64"),
        (b"a <=AgIAAAU5AAECAw=>", "not base64"),
        (b"a <AgIAAAU5 AAECAw==>", "not base64"),
        (b"a <AgIAAAU5\nAAECAw==>", "not base64"),
        (b"a <AgIAAAU5AAECAw==\n>", "not base64"),
        (b"a <AgIAAAU5AAECA-==>", "not base64"),
        (b"a <AgIAAAU5AAECAx==>", "bits are left over"),
        (b"a <AgIA\xc3\xbc>", "not base64"),
    ],
)
def test_what_is_no_legacy_payload_is_refused_by_name(payload: bytes, says: str):
    refused(lambda: VCaptain("me").read("", payload), says)


def test_an_empty_pair_of_brackets_is_an_empty_pdu():
    with pytest.raises(RefusedError) as error:
        profile("vcaptain").receive(Delivery("v2x/btp/2001", b"a(1): <>"))
    assert error.value.reason is Reason.EMPTY_PDU


@given(st.binary(min_size=6, max_size=1500), st.integers(0, 65535))
def test_every_pdu_comes_back_from_the_legacy_payload(pdu: bytes, port: int):
    payload = VCaptain("vm").write(Sending("cam", port, pdu, HERE, NOW_MS))
    assert payload == f"vm({port}): <{base64.b64encode(pdu).decode()}>".encode()
    assert VCaptain("me").read("", payload) == (pdu, "vm")


@given(st.binary(max_size=1500))
def test_every_pdu_comes_back_from_base64(pdu: bytes):
    payload = Base64().write(Sending("cam", 1, pdu, HERE, NOW_MS))
    assert payload == base64.b64encode(pdu)
    assert Base64().read("cam", payload) == (pdu, "")


@pytest.mark.parametrize("kind", AS_OCTETS)
def test_the_envelope_of_orange_is_that_of_its_schemas(kind: str):
    (found,) = profile("orange").publications(kind, 2001, PDU, HERE, NOW_MS)
    sent = json.loads(found.payload)
    topic = sent["message_type"]
    assert topic == kind
    Draft202012Validator(schema.envelope(kind, topic)).validate(sent)
    assert sent["message_format"] == "asn1/uper"
    assert sent["message"]["version"].startswith("ETSI ") or kind == "saem"
    assert base64.b64decode(sent["message"]["payload"]) == PDU
    named = "poim" if kind == "poi" else kind
    assert found.topic.split("/")[:5] == ["5GCroCo", "inQueue", "v2x", named, "com_car_1"]
    assert len(found.topic.split("/")[5:]) == 22


@pytest.mark.parametrize("kind", AS_JSON)
def test_the_envelope_of_orange_around_json_is_that_of_its_schemas(kind: str):
    (found,) = profile("orange").publications(kind, 2001, AS_JSON[kind], HERE, NOW_MS)
    sent = json.loads(found.payload)
    Draft202012Validator(schema.envelope(kind, message={"type": "object"})).validate(sent)
    assert "message_format" not in sent
    assert "payload" not in sent["message"]
    assert found.topic.split("/")[:5] == ["5GCroCo", "inQueue", "v2x", kind, "com_car_1"]
    assert len(found.topic.split("/")[5:]) == 22


@pytest.mark.parametrize("kind", [*AS_JSON, *WITHOUT_FORM])
def test_what_cannot_be_decoded_is_refused_where_the_schema_has_json_alone(kind: str):
    with pytest.raises(RequestError, match=f'{kind}: cannot be written as "json/raw": ') as error:
        profile("orange").publications(kind, 2001, PDU, HERE, NOW_MS)
    assert "[[publish]]" in error.value.hint


def test_json_longer_than_a_receiver_reads_is_not_sent(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(envelope, "MAX_PAYLOAD", 500)
    with pytest.raises(RequestError, match=r'denm: cannot be written as "json/raw": \d+ octets; at most 500'):
        profile("orange").publications("denm", 2002, AS_JSON["denm"], HERE, NOW_MS)


# Editions of the types whose PDUs are sent: preferred ones, and those of an older protocolVersion.
ANNOUNCED = [
    one for one in captain_messages.all() if one.type in AS_OCTETS and one.ids and (one.rank == 1 or one.release == 1)
]


@pytest.mark.parametrize("message", ANNOUNCED, ids=lambda message: message.name)
def test_the_envelope_of_orange_names_the_standard_of_the_header(message: Any):
    head = bytes((message.versions[-1], message.ids[0]))
    (found,) = profile("orange").publications(message.type, 1, head + PDU[2:], HERE, NOW_MS)
    said = json.loads(found.payload)["message"]["version"]
    assert said == message.standard.removesuffix(" (draft)")


def test_cams_of_orange_expire_and_maps_are_kept():
    pdus = {"cam": PDU, "mapem": AS_JSON["mapem"], "denm": AS_JSON["denm"]}
    found = {kind: profile("orange").publications(kind, 1, pdu, HERE, NOW_MS)[0] for kind, pdu in pdus.items()}
    assert [(found[kind].qos, found[kind].retain, found[kind].expiry_s) for kind in ("cam", "mapem", "denm")] == [
        (0, False, 1),
        (0, True, None),
        (0, False, None),
    ]


def moved(kind: str = "cam", **changes: Any) -> Delivery:
    """Return a message of another station as the platform delivers it, with changed members; `...` removes a member."""
    envelope = {name: value for name, value in (in_envelope(kind, PDU) | changes).items() if value is not ...}
    topic = OUT.replace("/cam/", f"/{'poim' if kind == 'poi' else kind}/")
    return Delivery(topic, json.dumps(envelope).encode())


@pytest.mark.parametrize("kind", NAMED)
def test_a_pdu_of_every_type_in_the_envelope_of_orange_is_taken(kind: str):
    assert profile("orange").receive(moved(kind)) == ReceivedPdu(PDU, None, "com_car_2")


@pytest.mark.parametrize("kind", [*AS_OCTETS, *AS_JSON])
def test_what_one_station_sends_by_orange_another_takes(kind: str):
    pdu = AS_JSON.get(kind, PDU)
    (found,) = profile("orange", uuid="com_car_2").publications(kind, 1, pdu, HERE, NOW_MS)
    delivery = delivered(found, found.topic.replace("inQueue", "outQueue"))
    assert profile("orange").receive(delivery) == ReceivedPdu(pdu, None, "com_car_2")


def test_a_map_that_the_broker_had_kept_is_taken_and_nothing_else():
    station = profile("orange")
    assert station.receive(moved("mapem")._replace(is_retained=True)).pdu == PDU
    with pytest.raises(RefusedError) as error:
        station.receive(moved("cam")._replace(is_retained=True))
    assert error.value.reason is Reason.RETAINED


def test_what_the_platform_hands_back_is_an_echo():
    with pytest.raises(RefusedError) as error:
        profile("orange", uuid="com_car_2").receive(moved())
    assert error.value.reason is Reason.OWN_ECHO


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"message_type": "denm"}, "message_type: 'denm' in a topic of 'cam'"),
        ({"message_type": ...}, "message_type: is missing"),
        ({"message_type": 2}, "message_type: 2 is not text"),
        ({"source_uuid": ...}, "source_uuid: is missing"),
        ({"source_uuid": None}, "source_uuid: null is not text"),
        ({"timestamp": ...}, "timestamp: is missing"),
        ({"timestamp": 1_514_764_799_999}, "timestamp: 1514764799999 is not in"),
        ({"timestamp": 1 << 64}, "timestamp: 18446744073709551616 is not in"),
        ({"timestamp": -1}, "timestamp: -1 is not in"),
        ({"timestamp": True}, "timestamp: true is not an integer"),
        ({"timestamp": 1.7e12}, "timestamp: 1700000000000.0 is not an integer"),
        ({"timestamp": "1700000000000"}, "timestamp: '1700000000000' is not an integer"),
        ({"version": 2}, "version: 2 is not text"),
        ({"message_format": "json/raw"}, "message.protocol_version: is missing"),
        ({"message_format": ...}, "message.protocol_version: is missing"),
        ({"message_format": "json"}, "message_format: 'json' is not read; the sender has to choose"),
        ({"message_format": ["asn1/uper"]}, "message_format: an array is not read"),
        ({"message": ...}, "message: is missing"),
        ({"message": []}, "message: an array is not an object"),
        ({"message": {"version": "x"}}, "message.payload: is missing"),
        ({"message": {"payload": 5}}, "message.payload: 5 is not text"),
        ({"message": {"payload": "AgI"}}, "message.payload is not base64"),
        ({"message": {"payload": "AgIü"}}, "message.payload is not base64"),
        ({"message": {"payload": "\ud800"}}, "message.payload is not base64"),
    ],
)
def test_an_envelope_of_another_schema_is_refused_with_the_member(changes: dict[str, Any], says: str):
    refused(lambda: profile("orange").receive(moved(**changes)), says)


@pytest.mark.parametrize("source", ["\ud800", "a\0b", "x" * 300])
def test_a_source_that_cannot_be_shown_is_left_out(source: str):
    assert profile("orange").receive(moved(source_uuid=source)) == ReceivedPdu(PDU, None, "")


def test_before_2018_nothing_is_sent_by_orange():
    with pytest.raises(RequestError, match="timestamp 1000 is before 2018"):
        profile("orange").publications("cam", 1, PDU, HERE, 1000)


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (b"nonsense", "not JSON"),
        (b'{"a": NaN}', "invalid number in JSON: NaN"),
        (b'{"a": -Infinity}', "invalid number in JSON: -Infinity"),
        (b'{"a": 1} x', "not JSON"),
        (b"\xff\xfe{\x00}\x00", "not JSON"),
        (b'{"a": "\xff"}', "not JSON"),
        (b"[]", "not an object: an array"),
        (b"null", "not an object: null"),
        (b"17", "not an object: 17"),
        (b'"' + b"x" * 100 + b'"', r"not an object: .*x\.\.\."),
        (b"1" * 5000, "not JSON"),
        (b"[" * 65_536, "deeper than 64"),
        (b'{"a":' * 10_000, "deeper than 64"),
        (b'{"a":' + b"[" * MAX_DEPTH + b"]" * MAX_DEPTH + b"}", "deeper than 64"),
        (b" " * 65_537, "65537 octets are above 65536"),
    ],
)
def test_what_is_no_bounded_json_object_is_refused_by_name(payload: bytes, says: str):
    refused(lambda: read_object(payload), says)


def test_json_may_be_as_deep_as_messages_are():
    assert read_object(b'{"a":' + b"[" * (MAX_DEPTH - 2) + b"]" * (MAX_DEPTH - 2) + b"}")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


@given(
    st.dictionaries(
        st.sampled_from([*schema.envelope("cam")["required"], "message_format", "origin", "x"]),
        VALUES,
        max_size=5,
    )
)
def test_an_envelope_with_any_value_in_it_is_taken_or_explained(changes: dict[str, Any]):
    taken_or_explained(moved(**changes))


@given(st.data())
def test_a_mutated_envelope_is_taken_or_explained(data: st.DataObject):
    payload = bytearray(moved().payload)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(payload) - 1))
        payload[at : at + data.draw(st.integers(0, 2))] = data.draw(st.binary(max_size=3))
    taken_or_explained(Delivery(OUT, bytes(payload)))


@given(st.data())
def test_a_mutated_legacy_payload_is_taken_or_explained(data: st.DataObject):
    payload = bytearray(VCaptain("vm2").write(SENT))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(payload) - 1))
        payload[at : at + data.draw(st.integers(0, 2))] = data.draw(st.binary(max_size=3))
    taken_or_explained(Delivery("v2x/btp/2001", bytes(payload)))


ORANGE, LEGACY = profile("orange"), profile("vcaptain")


def taken_or_explained(delivery: Delivery) -> None:
    station = LEGACY if delivery.topic.startswith("v2x") else ORANGE
    try:
        found = station.receive(delivery)
    except RefusedError as error:
        assert error.message
    else:
        assert 6 <= len(found.pdu) <= 1500
        assert len(found.source.encode()) <= 255


def test_the_rules_of_orange_are_of_types_that_exist():
    assert set(load("orange").types) <= set(NAMED)
    assert delivered(ORANGE.publications("cam", 1, PDU, HERE, NOW_MS)[0]).topic.startswith("5GCroCo/inQueue")
