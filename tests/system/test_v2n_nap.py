"""Vanetza-NAP's examples through a station and a real broker."""

import json

import pytest

from drivers.wire.v2n.payload.nap import NapReceived
from tests.broker.fixtures import Brokers
from tests.cases.nap import RECEIVED, TO_SEND, body, fields, unlike
from tests.drivers.wire.v2n.payload.nap import LIBRARY
from tests.system.conftest import Launcher
from tests.system.v2n import NAME, V2n, launched, until_up

NUMBERS = {"denm": 1, "cam": 2, "spatem": 4, "mapem": 5, "ivim": 6, "cpm": 14, "vam": 16, "mcm": 20}


@pytest.fixture(scope="module")
def nap(launch_shared: Launcher, brokers_shared: Brokers) -> V2n:
    """A station with this profile, and an application at its broker."""
    broker = brokers_shared()
    application = brokers_shared.client(broker).subscribe("vanetza/out/#", no_local=True)
    bench = launched(launch_shared, brokers_shared, broker.url, profile="nap")
    until_up(bench)
    return V2n(bench, broker, application)


@pytest.mark.parametrize("kind", TO_SEND)
def test_an_example_to_send_reaches_users_as_its_type_and_comes_back_with_its_values(nap: V2n, kind: str) -> None:
    nap.observer.publish(f"vanetza/in/{kind}", TO_SEND[kind].read_bytes())
    received = nap.bench.user.receive()
    assert (received.envelope, received.pdu[1]) == (f"v2x.{kind}.".encode(), NUMBERS[kind])
    nap.bench.user.send(received.envelope, received.pdu)
    _, back = json.loads(nap.observer.next(f"vanetza/out/{kind}").payload)["fields"].values()
    rounded = [".intersections[0].laneWidth: 3.25 came back as 325"] if kind == "mapem" else []
    assert unlike(body(kind), back) == rounded


@pytest.mark.parametrize("kind", RECEIVED)
def test_a_message_of_an_example_is_published_with_its_members_and_values(nap: V2n, kind: str) -> None:
    pdu, _ = NapReceived(7, LIBRARY).read(kind, RECEIVED[kind].read_bytes())
    nap.bench.user.send(f"v2x.{kind}.".encode(), pdu)
    assert json.loads(nap.observer.next(f"vanetza/out/{kind}").payload)["fields"] == fields(kind)
    assert nap.observer.next(f"vanetza/out/{kind}_enc").payload == pdu


def test_status_has_the_note_of_a_width_in_metres_and_the_reason_of_a_refusal(nap: V2n) -> None:
    nap.observer.publish("vanetza/in/mapem", TO_SEND["mapem"].read_bytes())
    assert nap.bench.user.receive().pdu[1] == 5
    status = nap.bench.station.until(lambda status: "note" in status["interfaces"][NAME].get("details", {}))
    assert "laneWidth: 3.25 read as 3.25 m (ASN.1 value 325)" in status["interfaces"][NAME]["details"]["note"]
    nap.observer.publish("vanetza/in/ivim", b'{"mandatory":{"serviceProviderId":7}}')
    detail = nap.dropped("payload", 1)["detail"]
    assert detail.startswith("vanetza/in/ivim: ivim-2")
    assert "serviceProviderId: 7 is not an object" in detail
