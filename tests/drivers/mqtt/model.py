"""Model of a session on virtual time: fake client, fake broker and station's end."""

import math
from collections.abc import Callable, Collection
from typing import Any, cast

from drivers.message import Ego, Position
from drivers.mqtt.client.session import Accepted, Session
from drivers.mqtt.client.settings import MqttSettings
from drivers.mqtt.profile import load
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.profile import Delivery, Identity, Profile, Publication, ReceivedPdu

URL = "mqtts://broker.example:8883"
UNIX_NS = 1_795_182_426_000_000_000
CAM = bytes.fromhex("0202000005390001020304")


class FakeClient:
    """Implementation of session.Client that records all calls in lists."""

    def __init__(self) -> None:
        self.waits_for = "no CONNACK"
        self.takes_more = True
        self.calls: list[str] = []
        self.devices: list[str] = []  # network device of each connect()
        self.published: dict[int, Publication] = {}
        self.subscribes: list[list[tuple[str, int]]] = []
        self.unsubscribes: list[list[str]] = []
        self.tokens = 0

    def connect(self, device: str) -> None:
        self.calls.append("connect")
        self.devices.append(device)

    def disconnect(self) -> None:
        self.calls.append("disconnect")

    def drop(self) -> None:
        self.calls.append("drop")

    def publish(self, publication: Publication) -> int:
        self.tokens += 1
        self.published[self.tokens] = publication
        return self.tokens

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None:
        self.subscribes.append(list(filters))

    def unsubscribe(self, filters: Collection[str]) -> None:
        self.unsubscribes.append(list(filters))


class Bench:
    """Started session, whose clock moves only when a test moves it."""

    def __init__(self, is_started: bool = True, profile: Profile | None = None, **how: Any) -> None:
        given: dict[str, Any] = {
            "url": URL,
            "types": ("cam", "denm", ""),
            "client_id": "vm",
            "host": "vm",
            "profile": "raw",
            **how,
        }
        self.settings = MqttSettings(**given)
        self.now = 1000.0
        self.client = FakeClient()
        self.said: list[bytes] = []
        self.takes = True  # the station reads what the session says
        self.jitter = 1.0
        identity = Identity("vm", 1337, "u", "")
        self.session = Session(
            self.settings,
            profile or Profile(load(self.settings.profile), identity),
            self.client,
            self._hear,
            lambda: self.jitter,
            lambda: UNIX_NS + int((self.now - 1000.0) * 1e9),
        )
        if is_started:
            self.session.start(self.now)

    def _hear(self, message: bytes) -> bool:
        if self.takes:
            self.said.append(message)
        return self.takes

    # The broker.

    def accept(self, **how: Any) -> "Bench":
        """Make the broker accept the connection and every subscription."""
        self.session.connected(Accepted(**how), self.now)
        self.session.subscribed({}, self.now)
        return self

    def deliver(self, topic: str, payload: bytes, **how: Any) -> None:
        self.session.received(Delivery(topic, payload, **how), self.now)

    def acknowledge(self, token: int, why: str = "") -> None:
        self.session.published(token, why, self.now)

    # The station.

    def send(self, number: int = 1, lifetime: float = 10.0, pdu: bytes = CAM) -> None:
        self.session.take(talk.send(talk.ToSend(number, self.now + lifetime, 2001, 0, pdu)), self.now)

    def bearer(self, is_up: bool, device: str = "wwan0") -> None:
        self.session.take(talk.bearer(is_up, device), self.now)

    def move(self, latitude: int, is_known: bool = True) -> None:
        self.session.take(talk.ego(Ego(0, Position(latitude, 0), is_known=is_known)), self.now)

    # Time.

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Advance the clock from deadline to deadline."""
        end = self.now + seconds
        turns = 0
        while not until():
            due = self.session.deadline()
            if due > end:
                break
            turns = turns + 1 if due <= self.now else 0
            assert turns < 5, f"deadline {due} does not move at {self.now}: a busy loop"
            self.now = max(self.now, due)
            self.session.expire(self.now)
        else:
            return
        if not math.isinf(end):
            self.now = end

    # Reports of the session.

    def all(self, kind: int) -> list[bytes]:
        return [message for message in self.said if message[0] == kind]

    @property
    def states(self) -> list[tuple[bool, str]]:
        return [talk.parse_state(message)[:2] for message in self.all(talk.STATE)]

    @property
    def is_up(self) -> bool:
        return bool(self.states) and self.states[-1][0]

    @property
    def sent(self) -> list[tuple[int, Reason | None, str]]:
        return [talk.parse_sent(message) for message in self.all(talk.SENT)]

    @property
    def outcomes(self) -> dict[int, Reason | None]:
        found = {number: reason for number, reason, _ in self.sent}
        assert len(found) == len(self.sent), "a request is answered twice"
        return found

    @property
    def drops(self) -> dict[Reason, int]:
        found: dict[Reason, int] = {}
        for message in self.all(talk.DROPPED):
            reason, count, *_ = talk.parse_dropped(message)
            found[reason] = found.get(reason, 0) + count
        return found

    @property
    def whys(self) -> list[tuple[Reason, str]]:
        """Reason and detail of the last drop in each report."""
        return [(reason, why) for reason, _, _, why in map(talk.parse_dropped, self.all(talk.DROPPED))]

    @property
    def topics(self) -> list[str]:
        return [publication.topic for publication in self.client.published.values()]


class Tiles:
    """Profile with a single subscription, whose topic is the latitude; it publishes a given number of times."""

    def __init__(self, publications: int = 1, qos: int = 1) -> None:
        self.missing = self.noted = ""
        self.count, self.qos = publications, qos

    def publications(self, kind: str, btp_port: int, pdu: bytes, own: Ego, now_ms: int) -> list[Publication]:
        return [Publication(f"t{n}", pdu, self.qos, True, None) for n in range(self.count)]

    def subscriptions(self, own: Ego) -> frozenset[tuple[str, int]]:
        return frozenset({(str(own.position.latitude), 1), ("all", 0)})

    def lacks(self, own: Ego) -> tuple[bool, str]:
        return False, ""

    def receive(self, delivery: Delivery) -> ReceivedPdu:
        return ReceivedPdu(delivery.payload, None, "")

    def connected(self) -> Publication | None:
        return None

    closing = lost = connected


def tiles(publications: int = 1, qos: int = 1, **how: Any) -> Bench:
    return Bench(profile=cast(Profile, Tiles(publications, qos)), **how)


def vcaptain() -> Bench:
    return Bench(profile=Profile(load("vcaptain"), Identity("vm", 1, "u", "")))
