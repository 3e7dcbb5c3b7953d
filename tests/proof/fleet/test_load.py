"""Load of a vehicle, compared with the profiles' own topics and filters."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import Client, MQTTv5, topic_matches_sub
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from drivers.message import Ego, Position
from drivers.mqtt.profile import codec, load
from drivers.wire import quadkey
from drivers.wire.v2n.message import Identity
from drivers.wire.v2n.profile import Profile, Publication
from tests.proof.fleet import tiles
from tests.proof.fleet.brokers import Bridges, Cluster, balanced, equal
from tests.proof.fleet.carried import NOW_MS, carried, packet_octets
from tests.proof.fleet.limits import Limits, breaks
from tests.proof.fleet.load import Fleet, Load
from tests.proof.fleet.rates import CAM, PORTS, recorded
from tests.proof.fleet.region import traffic

PROFILES = ("vcaptain", "raw", "orange", str(Path(__file__).with_name("tiles.toml")))
FLEET = Fleet(traffic(1, 20_000))
# Around the middle, where they hear each other.
NEAR = sorted(range(FLEET.size), key=lambda at: FLEET.vehicles[at].x ** 2 + FLEET.vehicles[at].y ** 2)[:2000:40]


def profiles(name: str, fleet: Fleet) -> list[tuple[Profile, Ego]]:
    found = []
    for number, vehicle in enumerate(fleet.vehicles):
        latitude, longitude = vehicle.place
        own = Ego(0, Position(round(latitude * 1e7), round(longitude * 1e7)), True, round(vehicle.speed * 100))
        found.append((Profile(load(name), Identity(f"v{number}", number, f"u{number}", "v2n"), None), own))
    return found


@pytest.mark.parametrize("name", PROFILES)
def test_a_vehicle_hears_those_whose_topics_its_filters_let_through(name: str) -> None:
    fleet = FLEET.part(NEAR)
    each = profiles(name, fleet)
    pdu = recorded()[CAM]
    topics = [made.publications("cam", PORTS["cam"], pdu, own, NOW_MS)[0].topic for made, own in each]
    copied = [topic.replace("/inQueue/", "/outQueue/") for topic in topics]
    computed = Load(fleet, carried(name))
    for at, (made, own) in enumerate(each):
        filters = [text for text, _ in made.subscriptions(own)]
        senders = [
            sender
            for sender, topic in enumerate(copied)
            if any(topic_matches_sub(text, topic) for text in filters) and (sender != at or topics[at] != topic)
        ]
        heard = sum(computed.sent[sender].messages for sender in senders)
        assert computed.received[at].messages == pytest.approx(heard)


@given(latitude=st.floats(48.4, 49.1), longitude=st.floats(11, 12), depth=st.integers(1, 22))
def test_tiles_are_those_of_the_profiles(latitude: float, longitude: float, depth: int) -> None:
    # The profiles' positions have 1e-7 degree: the place is one of those.
    place = Position(round(latitude * 1e7), round(longitude * 1e7))
    ours = tiles.above(tiles.tile(place.latitude / 1e7, place.longitude / 1e7), depth)
    theirs = quadkey.tile(place, depth)
    assert ours == (theirs.column, theirs.row)
    assert tiles.quadkey(ours, depth) == theirs.digits()
    if depth > 1:
        assert set(tiles.neighbours(ours)) == {(near.column, near.row) for near in theirs.around()}


@pytest.mark.parametrize("qos", [0, 1])
@pytest.mark.parametrize("expiry_s", [None, 1])
@pytest.mark.parametrize("octets", [0, 100, 127, 128, 20_000])
def test_the_octets_of_a_packet_are_those_that_paho_sends(
    qos: int, expiry_s: int | None, octets: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = Client(CallbackAPIVersion.VERSION2, "c", protocol=MQTTv5)
    packets: list[bytes] = []

    def queue(command: int, packet: bytes, *_: Any) -> int:
        packets.append(packet)
        return 0

    monkeypatch.setattr(client, "_packet_queue", queue)
    monkeypatch.setattr(client, "_sock", object())
    properties = Properties(PacketTypes.PUBLISH)
    if expiry_s is not None:
        properties.MessageExpiryInterval = expiry_s
    payload = bytes(octets)
    client._send_publish(1, b"v2x/cam", payload, qos, False, False, None, properties)
    monkeypatch.setattr(client, "_sock", None)
    assert packet_octets(Publication("v2x/cam", payload, qos, False, expiry_s)) == len(packets[0])


@pytest.mark.parametrize("name", [*PROFILES, "nap"])
def test_a_limit_is_reached_where_it_is_said_to_be(name: str) -> None:
    one = carried(name)
    limits = Limits(downlink=4e6, broker_rate=1e6)
    downlink, one_broker = breaks(Load(FLEET, one), limits)
    assert Load(FLEET.part(range(downlink)), one).downlink.busy == pytest.approx(limits.downlink, rel=0.15)
    there = Load(FLEET.part(range(one_broker)), one).delivered.messages
    assert there == pytest.approx(limits.broker_rate, rel=0.15)


def clusters(load: Load) -> Sequence[Cluster]:
    return equal(load, 11), balanced(load, 12)


def test_everybody_is_with_one_broker_and_bridges_lose_nothing() -> None:
    whole = Load(FLEET, carried("orange"))
    for cluster in clusters(whole):
        for bridges in Bridges:
            several = cluster.brokers(bridges, 15).values()
            assert sum(each.vehicles for each in several) == FLEET.size
            assert sum(each.taken for each in several) == pytest.approx(whole.total.messages)
            assert sum(each.delivered for each in several) == pytest.approx(whole.delivered.messages)
            assert sum(each.bridged_in for each in several) == pytest.approx(sum(each.bridged_out for each in several))


def test_a_balanced_cut_has_a_smaller_busiest_broker_than_an_equal_one() -> None:
    whole = Load(FLEET, carried("orange"))
    even = equal(whole, 10)
    cut = balanced(whole, len(even.members))
    assert len(cut.members) >= len(even.members)
    busiest = [max(each.out for each in one.brokers(Bridges.EDGES, 15).values()) for one in (even, cut)]
    assert busiest[1] < busiest[0]


def test_what_crosses_an_edge_is_in_a_tile_that_bridges_carry() -> None:
    fleet = FLEET.part(NEAR)
    load = Load(fleet, carried("orange"))
    cluster = equal(load, 14)
    edges = cluster._edges(15)
    carried_between = {(origin, target) for origin, target, _ in edges}
    owners = {at: shard for shard, each in cluster.members.items() for at in each}
    crossings = 0
    for at, place in enumerate(fleet.places):
        depth = load.depths[at]
        near = set(tiles.neighbours(tiles.above(place, depth)))
        for sender, other in enumerate(fleet.places):
            if tiles.above(other, depth) in near and owners[sender] != owners[at]:
                crossings += 1
                assert (owners[sender], owners[at]) in carried_between
    assert crossings > 0


def test_without_bridges_one_broker_hears_all_and_several_do_not() -> None:
    load = Load(FLEET, carried("orange"))
    assert equal(load, 4).unheard() == pytest.approx(0)
    assert 0 < equal(load, 12).unheard() < 1


def test_nap_is_read_by_the_library_and_repeats_a_CAM_three_times() -> None:
    one = carried("nap")
    assert codec(load("nap")) is not None
    assert (one.sent[CAM].messages, one.heard[CAM].messages) == (3, 2)
