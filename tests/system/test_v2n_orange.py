"""Orange's JSON through a station and a real broker: what its vehicles send, and what its applications receive."""

import json
from typing import Any

import pytest

from tests.broker.fixtures import Brokers
from tests.cases import orange
from tests.cases.test_orange import VEHICLE, WITH_SCHEMA
from tests.drivers.wire.v2n.station import AS_JSON, SENDABLE, VECTORS, WITHOUT_JSON, in_envelope
from tests.system.conftest import Launcher
from tests.system.station import toml_table
from tests.system.user import mark
from tests.system.v2n import NAME, V2n, table, until_up

PLACE = {"latitude": 48.7668616, "longitude": 11.432068}


@pytest.fixture(scope="module")
def orange_station(launch_shared: Launcher, brokers_shared: Brokers) -> V2n:
    """A station with this profile and a surveyed place, and an application at its broker."""
    broker = brokers_shared()
    application = brokers_shared.client(broker).subscribe("5GCroCo/inQueue/v2x/#", no_local=True)
    more = toml_table(f"interfaces.{NAME}", table(brokers_shared, broker.url, profile="orange", uuid="com_car_1"))
    bench = launch_shared("btp", station={"position": PLACE}, more=more)
    until_up(bench)
    return V2n(bench, broker, application)


@pytest.mark.parametrize(("kind", "pdu"), SENDABLE)
def test_a_message_is_published_as_its_schema_says_and_received_by_another(
    orange_station: V2n, kind: str, pdu: bytes
) -> None:
    orange_station.bench.user.send(f"v2x.{kind}.".encode(), pdu)
    message = orange_station.observer.next()
    envelope: dict[str, Any] = json.loads(message.payload)
    assert ("payload" in envelope["message"]) is (kind not in WITH_SCHEMA)
    if kind in WITH_SCHEMA:
        orange.check(kind, envelope)
    orange_station.observer.publish(
        message.topic.replace("inQueue", "outQueue"), json.dumps(envelope | {"source_uuid": "ora_car_1"})
    )
    received = orange_station.bench.user.receive()
    assert (received.envelope, received.pdu) == (f"v2x.{kind}.".encode(), pdu)


@pytest.mark.parametrize(("kind", "size"), WITHOUT_JSON)
def test_a_message_that_json_cannot_hold_is_send_failed_with_its_path_and_the_next_one_passes(
    orange_station: V2n, kind: str, size: int
) -> None:
    (pdu,) = (pdu for of, pdu in VECTORS if (of, len(pdu)) == (kind, size))
    reports, user = orange_station.bench.make_reports(), orange_station.bench.user
    envelope = f"v2x.{kind}.".encode()
    user.push_pdu(envelope, pdu, label="refused", interfaces=[NAME])
    _, dropped = reports.confirms_of("refused", 2)
    assert (dropped["outcome"], dropped["interface"], dropped["reason"]) == ("dropped", NAME, "send-failed")
    said = f'{kind}: cannot be written as "json/raw": {WITHOUT_JSON[kind, size]}'
    assert said in dropped["detail"]
    user.push_pdu(envelope, AS_JSON[kind], label="next", interfaces=[NAME])
    _, sent = reports.confirms_of("next", 2)
    assert (sent["outcome"], sent["reason"]) == ("sent", None)
    published = json.loads(orange_station.observer.next().payload)
    orange.check(kind, published)
    assert published["message"]["station_id"] == int.from_bytes(AS_JSON[kind][2:6], "big")


@pytest.mark.parametrize(("kind", "pdu"), VECTORS)
def test_a_pdu_in_base64_of_another_reaches_users(orange_station: V2n, kind: str, pdu: bytes) -> None:
    orange_station.bench.user.send(b"v2x.cam.", mark())
    topic = orange_station.observer.next().topic.replace("inQueue", "outQueue").replace("/cam/", f"/{kind}/")
    orange_station.observer.publish(topic, json.dumps(in_envelope(kind, pdu, "ora_car_1")))
    received = orange_station.bench.user.receive()
    assert (received.envelope, received.pdu) == (f"v2x.{kind}.".encode(), pdu)


def test_a_cam_1_1_3_of_their_vehicle_reaches_users_and_an_invalid_one_is_dropped_with_its_path(
    orange_station: V2n,
) -> None:
    orange_station.bench.user.send(b"v2x.cam.", VECTORS[1][1])
    topic = orange_station.observer.next().topic.replace("inQueue", "outQueue")
    orange_station.observer.publish(topic, json.dumps(VEHICLE))
    received = orange_station.bench.user.receive()
    assert (received.envelope, received.pdu[:2]) == (b"v2x.cam.", b"\x01\x02")
    wrong = json.loads(json.dumps(VEHICLE))
    wrong["message"]["high_frequency_container"]["speed"] = "fast"
    orange_station.observer.publish(topic, json.dumps(wrong))
    assert "speed.value: 'fast' is not an integer" in orange_station.dropped("payload", 1)["detail"]
