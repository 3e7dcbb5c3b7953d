"""Cost of a message in a profile: MQTT octets, IP octets, receivers.

Asked of the profiles themselves, with recorded messages: nothing about their topics and payloads is assumed here.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from drivers.message import Ego, Position
from drivers.mqtt.profile import codec, load
from drivers.wire.v2n.description import Tiles
from drivers.wire.v2n.message import Identity
from drivers.wire.v2n.profile import Profile, Publication
from tests.proof.fleet.rates import MESSAGES, PORTS, Message, Rates, recorded
from tests.proof.fleet.region import LATITUDE, LONGITUDE
from tests.proof.fleet.tiles import Flow

# Around a record of TLS 1.3: its header 5, its type 1, its tag 16 (RFC 8446, 5.2); TCP with time stamps 32, IPv4 20.
# Every message is a segment of its own: at tens a second none waits for the next.
AROUND = 22 + 52
PUBACK = 4  # MQTT 5.0, 3.4: success, without properties

VEHICLE = Identity(host="vehicle-00000", station=1337, uuid="com_fleet_car_00000", prefix="v2n")
OWN = "/own/"  # nap repeats a vehicle's own CAMs there, for the vehicle itself
HERE = Ego(0, Position(round(LATITUDE * 1e7), round(LONGITUDE * 1e7)), True, 1390, 900)
NOW_MS = 1_795_182_426_000


class Carried(NamedTuple):
    """A profile, seen by who pays for it.

    profile  its name among those that ship, or its file.
    sent     what a vehicle publishes for each recorded message: packets and their octets.
    heard    what another one is sent for it.
    qos      1: a PUBACK goes the other way for each packet.
    tiles    depths by speed where a vehicle receives only from around it; None: from everywhere.
    has_echo  whether a vehicle is sent its own messages: where it receives on other topics than it publishes on, somebody
             copies them, and noLocal (MQTT 5.0, 3.8.3.1) does not hold for copies.
    """

    name: str
    profile: str
    sent: Mapping[Message, Flow]
    heard: Mapping[Message, Flow]
    qos: int
    tiles: Tiles | None
    has_echo: bool

    def depth(self, speed: float) -> int:
        """Of the tiles that a vehicle subscribes to, at a speed in m/s: without the hysteresis of the profile."""
        assert self.tiles is not None
        return max(1, self.tiles.subscribe_depth - sum(speed >= limit for limit in self.tiles.speeds_m_s))

    def ip_bits(self, flow: Flow, acknowledged: float) -> float:
        """Bits a second at the IP layer, one way.

        flow          of PUBLISH packets that way.
        acknowledged  PUBLISH packets a second the other way.
        """
        answers = acknowledged * (PUBACK + AROUND) if self.qos else 0.0
        return 8 * (flow.octets + flow.messages * AROUND + answers)


def total(each: Mapping[Message, Flow], rates: Rates) -> Flow:
    """Packets and octets a second, of what each message makes of them."""
    messages = octets = 0.0
    for message, hz in zip(MESSAGES, rates, strict=True):
        flow = each[message]
        messages += flow[0] * hz
        octets += flow[1] * hz
    return Flow(messages, octets)


def carried(name: str) -> Carried:
    """A profile that ships, or the path of a TOML file."""
    description = load(name)
    made = Profile(description, VEHICLE, codec(description))
    pdus = recorded()
    sent: dict[Message, Flow] = {}
    heard: dict[Message, Flow] = {}
    for message in MESSAGES:
        packets = made.publications(message[0], PORTS[message[0]], pdus[message], HERE, NOW_MS)
        sent[message] = _flow(packets)
        heard[message] = _flow([packet for packet in packets if OWN not in packet.topic])
    has_tiles = any("{quadkey}" in row.topic for row in description.subscribe)
    fronts = [
        {row.topic.partition("{quadkey}")[0] for row in rows} for rows in (description.publish, description.subscribe)
    ]
    has_echo = has_tiles and fronts[0] != fronts[1]
    return Carried(
        description.name, name, sent, heard, description.qos, description.tiles if has_tiles else None, has_echo
    )


def _flow(packets: Sequence[Publication]) -> Flow:
    return Flow(len(packets), sum(map(packet_octets, packets)))


def packet_octets(publication: Publication) -> int:
    """Octets of PUBLISH (MQTT 5.0, 3.3): topic, identifier, properties, payload, and the header in front."""
    properties = 0 if publication.expiry_s is None else 5
    rest = 2 + len(publication.topic.encode()) + (2 if publication.qos else 0)
    rest += _length_octets(properties) + properties + len(publication.payload)
    return 1 + _length_octets(rest) + rest


def _length_octets(number: int) -> int:
    """Of a variable byte integer (MQTT 5.0, 1.5.5)."""
    return 1 if number < 1 << 7 else 2 if number < 1 << 14 else 3 if number < 1 << 21 else 4
