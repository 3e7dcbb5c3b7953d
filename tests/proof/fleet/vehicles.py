"""Hundreds of vehicles in one process: a paho client each, all in one loop, publishing at the rates of the simulation."""

import heapq
import random
import selectors
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from paho.mqtt.client import Client, MQTTv5
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from drivers.message import Ego, Position
from drivers.mqtt.profile import codec, load
from drivers.wire.v2n.message import Identity
from drivers.wire.v2n.profile import Profile, Publication
from tests.proof.fleet.carried import packet_octets
from tests.proof.fleet.rates import PORTS, Message, Rates, recorded
from tests.proof.fleet.region import Vehicle

PATIENCE = 20.0  # s; reached only where something fails
PREFIX = "v2n"


class Driven:
    """One vehicle with its client. Counts what it published and was sent: packets, octets of them, by sender."""

    def __init__(self, number: int, vehicle: Vehicle, rates: Rates, profile: str, port: int) -> None:
        self.number = number
        self.port = port
        self.rates = rates
        self.published = self.heard = 0
        self.published_octets = self.heard_octets = 0
        self.is_ready = False
        self._publications: dict[Message, list[Publication]] = {}
        latitude, longitude = vehicle.place
        place = Position(round(latitude * 1e7), round(longitude * 1e7))
        self._own = Ego(0, place, True, round(vehicle.speed * 100))
        description = load(profile)
        identity = Identity(f"vehicle-{number:05}", number, f"com_fleet_car_{number:05}", PREFIX)
        self._profile = Profile(description, identity, codec(description))
        self.client = client = Client(CallbackAPIVersion.VERSION2, identity.host, protocol=MQTTv5)
        client.max_inflight_messages_set(0)
        client.on_message = self._on_message
        client.on_connect = self._on_connect
        client.on_subscribe = self._on_subscribe
        client.connect("127.0.0.1", port, 60)

    def publish(self, message: Message, pdu: bytes) -> None:
        for publication in self._made(message, pdu):
            self.published += 1
            self.published_octets += packet_octets(publication)
            self.client.publish(
                publication.topic, publication.payload, publication.qos, properties=_properties(publication)
            )

    def _made(self, message: Message, pdu: bytes) -> list[Publication]:
        """Made once: to the broker it is as good as a fresh one, and nap's takes a millisecond."""
        if message not in self._publications:
            numbered = pdu[:2] + self.number.to_bytes(4) + pdu[6:]
            now_ms = time.time_ns() // 1_000_000
            made = self._profile.publications(message[0], PORTS[message[0]], numbered, self._own, now_ms)
            self._publications[message] = made
        return self._publications[message]

    def filters(self) -> list[tuple[str, int]]:
        """nap gives vehicles nothing of each other by itself: they hear what others put out, not their own `own`."""
        if self._profile.description.name == "nap":
            return [("vanetza/out/+", 0)]
        return sorted(self._profile.subscriptions(self._own))

    def _on_connect(self, client: Client, *_: Any) -> None:
        client.subscribe([(text, SubscribeOptions(qos, noLocal=True)) for text, qos in self.filters()])

    def _on_subscribe(self, client: Client, userdata: object, mid: int, codes: Sequence[Any], _: object) -> None:
        assert not any(code.is_failure for code in codes), codes
        self.is_ready = True

    def _on_message(self, client: Client, userdata: object, message: Any) -> None:
        self.heard += 1
        expiry_s = getattr(message.properties, "MessageExpiryInterval", None)
        self.heard_octets += packet_octets(Publication(message.topic, message.payload, message.qos, False, expiry_s))


def _properties(publication: Publication) -> Properties | None:
    if publication.expiry_s is None:
        return None
    properties = Properties(PacketTypes.PUBLISH)
    properties.MessageExpiryInterval = publication.expiry_s
    return properties


class Drive:
    """All of them, in one loop. sent: recorded messages, by vehicle and which."""

    def __init__(self, driven: Sequence[Driven], seed: int) -> None:
        self.driven = driven
        self.sent: Counter[tuple[int, Message]] = Counter()
        self._pdus = recorded()
        self._selector = selectors.DefaultSelector()
        self._dice = random.Random(seed)
        for each in driven:
            self._selector.register(each.client.socket(), selectors.EVENT_READ, each)
        self._turn_until(lambda: all(each.is_ready for each in driven), PATIENCE, "subscribed")

    def publish_for(self, duration_s: float) -> None:
        """Each message at its own pace, from a random moment on, for so long."""
        queue = [
            (self._dice.uniform(0, 1 / hz), 1 / hz, at, message)
            for at, each in enumerate(self.driven)
            for message, hz in each.rates.by_message
            if hz > 0
        ]
        heapq.heapify(queue)
        began = time.monotonic()
        while queue[0][0] < duration_s:
            due, period, at, message = queue[0]
            if (wait := began + due - time.monotonic()) > 0:
                self._turn(wait)
                continue
            heapq.heapreplace(queue, (due + period, period, at, message))
            self.driven[at].publish(message, self._pdus[message])
            self.sent[at, message] += 1
        self.late_s = time.monotonic() - began - duration_s

    def settle(self, expected: Callable[[], bool], longest_s: float) -> None:
        """Until everything that is expected is there, or for so long."""
        self._turn_until(expected, longest_s, "")

    def close(self) -> None:
        for each in self.driven:
            self._selector.unregister(each.client.socket())
            each.client.disconnect()
            each.client.loop_write()
            if (line := each.client.socket()) is not None:
                line.close()
        self._selector.close()

    def _turn_until(self, is_done: Callable[[], bool], longest_s: float, what: str) -> None:
        end = time.monotonic() + longest_s
        while not is_done() and time.monotonic() < end:
            self._turn(0.05)
        assert is_done() or not what, f"not all vehicles are {what} after {longest_s} s"

    def _turn(self, longest_s: float) -> None:
        for key, _ in self._selector.select(longest_s):
            client = key.data.client
            code = client.loop_read()
            assert not code, f"vehicle {key.data.number}: {code!r}"
            if client.want_write():
                client.loop_write()
