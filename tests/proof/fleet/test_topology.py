"""The configurations and the profile that drivers/guide/fleets.md shows, run: two brokers with TLS and an edge between them."""

import queue
import re
from contextlib import suppress
from pathlib import Path

import pytest

from drivers.message import Ego, Position
from drivers.mqtt.profile import load
from drivers.wire.v2n.message import Delivery, Identity
from drivers.wire.v2n.profile import Profile
from tests.broker.client import Client
from tests.broker.fixtures import Brokers
from tests.broker.mosquitto import Mosquitto
from tests.proof.fleet.carried import NOW_MS
from tests.proof.fleet.tiles import DEEPEST, Tile, quadkey, tile
from tests.proof.fleet.two_brokers import EDGE, EDGE_DEPTH, MIDDLE

TEXT = (Path(__file__).parents[3] / "drivers" / "guide" / "fleets.md").read_text()
BLOCKS = dict(re.findall(r"^```(?:conf|toml) (\w+)\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL))
TILES = Path(__file__).with_name("tiles.toml")
# Beside what is shown: this test's user, and its log, which tells when the broker and its bridges are there.
OURS = "user root\nlog_dest stderr\nlog_type notice\nlog_type information\nlog_type error\nlog_type subscribe\n"
CAM = bytes.fromhex("02020000053900010203")
ROW = MIDDLE[1] >> DEEPEST - EDGE_DEPTH


def configured(brokers: Brokers, *blocks: str, east: Mosquitto | None = None) -> Mosquitto:
    """A broker with blocks of fleets.md: other ports, other hosts, other folders; not started."""
    made = brokers.stopped()
    bridge = made.authority.client("bridge")
    files = {
        "ca.pem": made.authority.certificate,
        "broker.pem": brokers.certificates.server.certificate,
        "broker.key": brokers.certificates.server.key,
        "bridge.pem": bridge.certificate,
        "bridge.key": bridge.key,
    }
    text = "".join(BLOCKS[name] for name in blocks).replace("listener 8883", f"listener {made.port} 127.0.0.1")
    if east is not None:
        text = text.replace("east.example:8883", f"localhost:{east.port}")
    text = text.replace("localhost:8883", f"localhost:{made.port}")
    for name, path in files.items():
        text = text.replace(f"/etc/mosquitto/{name}", str(path))
    assert "/etc/" not in text
    assert "example" not in text
    made.file.write_text(OURS + text)
    return made


def places() -> tuple[Tile, Tile]:
    """At DEEPEST, on both sides of the edge and next to it."""
    x, y = EDGE << DEEPEST - EDGE_DEPTH, (ROW << DEEPEST - EDGE_DEPTH) + 60
    return (x - 1, y), (x, y)


def vehicle(name: str, place: Tile, profile: str) -> tuple[Profile, Ego]:
    size = 1 << DEEPEST
    longitude = (place[0] + 0.5) / size * 360 - 180
    latitude = next(at / 1e4 for at in range(480_000, 500_000) if tile(at / 1e4, longitude)[1] <= place[1])
    own = Ego(0, Position(round(latitude * 1e7), round(longitude * 1e7)), True)
    prefix = "v2n" if profile == "orange" else ""
    return Profile(load(profile), Identity(name, 1337, name, prefix)), own


def connected(brokers: Brokers, broker: Mosquitto, profile: Profile, own: Ego) -> Client:
    filters = [text for text, _ in profile.subscriptions(own)]
    return brokers.client(broker, profile.identity.host, identity=brokers.certificates.client).subscribe(
        *filters, qos=0
    )


def send(client: Client, profile: Profile, own: Ego, pdu: bytes = CAM) -> None:
    (publication,) = profile.publications("cam", 2001, pdu, own, NOW_MS)
    client.publish(publication.topic, publication.payload, qos=0, expiry_s=publication.expiry_s)


def crossed(sender: Client, end: tuple[Profile, Ego], pdu: bytes, receiver: Client) -> bytes:
    """Send until the first message arrives, and return its payload: a bridge passes nothing on while it starts."""
    for _ in range(20):
        send(sender, *end, pdu=pdu)
        with suppress(queue.Empty):
            return receiver.messages.get(timeout=0.25).payload
    raise AssertionError(f"nothing of {pdu!r} crossed")


def test_the_tiles_of_the_example_are_those_on_both_sides_of_an_edge() -> None:
    named = re.findall(r"^topic fleet/(\S+)/# (out|in) 0$", BLOCKS["bridge"], re.MULTILINE)
    west, east = ("/".join(quadkey((column, ROW), EDGE_DEPTH)) for column in (EDGE - 1, EDGE))
    assert named == [(west, "out"), (east, "in")]


def test_the_profile_that_is_shown_is_the_one_that_is_measured() -> None:
    shown = BLOCKS["tiles"]
    assert shown in TILES.read_text()


def test_two_brokers_pass_on_what_crosses_their_edge_and_nothing_else(brokers: Brokers) -> None:
    east = configured(brokers, "broker").start()
    west = configured(brokers, "broker", "bridge", east=east).start()
    east.says(r"fleet/\S+/#")  # what the bridge asks for
    ends = [vehicle(name, place, str(TILES)) for name, place in zip(("w", "e"), places(), strict=True)]
    western = connected(brokers, west, *ends[0])
    eastern = connected(brokers, east, *ends[1])
    far = (places()[0][0] - 3 * 128, places()[0][1])
    stranger = vehicle("far", far, str(TILES))
    remote = brokers.client(east, "remote", identity=brokers.certificates.client).subscribe("fleet/#", qos=0)

    send(western, *stranger, pdu=CAM + b"far")
    assert crossed(western, ends[0], CAM + b"west", eastern) == CAM + b"west"
    assert remote.next().payload == CAM + b"west"
    send(eastern, *ends[1], pdu=CAM + b"east")
    while (heard := western.next()).payload != CAM + b"east":
        assert heard.payload == CAM + b"west"  # its own: this client has no noLocal


def test_a_broker_with_a_loop_copies_what_orange_publishes_to_where_it_listens(brokers: Brokers) -> None:
    broker = configured(brokers, "broker", "loop").start()
    broker.says("New client connected from .* as .*loop")
    one, other = (vehicle(name, place, "orange") for name, place in zip(("w", "e"), places(), strict=True))
    listening = connected(brokers, broker, *other)

    send(brokers.client(broker, "w", identity=brokers.certificates.client), *one)

    message = listening.next()
    assert message.topic.startswith("v2n/outQueue/v2x/cam/w/1/2/0/2/")
    assert other[0].receive(Delivery(message.topic, message.payload)).pdu == CAM


def test_a_client_without_a_certificate_is_not_let_in(brokers: Brokers) -> None:
    broker = configured(brokers, "broker").start()
    with pytest.raises((OSError, AssertionError)):
        Client(broker.port, "nobody", authority=broker.authority)
