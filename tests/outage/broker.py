"""A broker in virtual time, and the process with the MQTT client played in front of it: the session in it is the real one.

What a connection says of itself is modelled as far as it costs time: a handshake is three ways and two, an
acknowledgement one, and a keep-alive is paho's.
"""

from collections.abc import Callable, Collection

from board.loop import Loop, Timer
from drivers.mqtt_client import profile_of
from drivers.mqtt_session import Session
from drivers.mqtt_settings import MqttSettings, settings
from drivers.mqtt_window import Accepted
from drivers.wire.v2n import Publication
from tests.chaos.processes import PlayedChild, Say
from tests.outage.network import Line, Network

# Octets: TLS 1.3 with a certificate of each end; an MQTT packet but for topic and payload, in its TLS record.
HELLO, CERTIFICATES, ANSWER = 300, 2500, 1500
PACKET = 35

SAID_S = 0.0002  # from the child to the station
UNIX_NS = 1_800_000_000_000_000_000  # at loop time 0


class Broker:
    """Takes what arrives: `arrived` is called with each publication."""

    def __init__(self, loop: Loop, network: Network, arrived: Callable[[str, Publication], None]) -> None:
        self.loop = loop
        self.network = network
        self.arrived = arrived
        self.connections = 0


class ModelClient:
    """mqtt_session.Client. name is the client id; stall_s as Line has it."""

    def __init__(self, broker: Broker, name: str, keep_alive_s: float, stall_s: float) -> None:
        self.session: Session
        self.after: Callable[[], None] = lambda: None  # called when the session was told something
        self.waits_for = "no answer to SYN"
        self._broker = broker
        self._loop = broker.loop
        self._name = name
        self._keep_alive_s = keep_alive_s
        self._stall_s = stall_s
        self._line: Line | None = None
        self._is_accepted = False
        self._tokens = 0
        self._timer: Timer | None = None

    @property
    def line(self) -> Line | None:
        """The connection, when the broker has accepted it."""
        return self._line if self._is_accepted else None

    @property
    def takes_more(self) -> bool:
        return self._line is not None and self._line.up.has_room

    def connect(self, device: str = "") -> None:
        self.drop()
        network = self._broker.network
        if not network.is_attached:
            self._tell(lambda now: self.session.failed("no route to it", now, is_away=True))
            return
        self.waits_for = "no answer to SYN"
        line = self._line = Line(network, self._stall_s, self._ended)
        line.up.on_room = lambda: self._now(self.session.writable)
        up, down = line.up.send, line.down.send

        def greeted() -> None:
            self.waits_for = "no answer to the TLS handshake"
            up(HELLO, lambda: down(CERTIFICATES, shown))

        def shown() -> None:
            self.waits_for = "no CONNACK"
            up(ANSWER + PACKET, lambda: down(PACKET, self._accepted))

        up(0, lambda: down(0, greeted))

    def disconnect(self) -> None:
        self.drop()

    def drop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._line is not None:
            self._line.close()
            self._line = None
        self._is_accepted = False

    def publish(self, publication: Publication) -> int:
        line = self._line
        assert line is not None
        assert self._is_accepted
        self._tokens += 1
        token = self._tokens
        self._last_out = self._loop.clock()
        octets = PACKET + len(publication.topic) + len(publication.payload)

        def acknowledged() -> None:
            self._last_in = now = self._loop.clock()
            self.session.published(token, "", now)
            self.after()

        def arrived() -> None:
            self._broker.arrived(self._name, publication)
            if publication.qos:
                line.down.send(PACKET, acknowledged)

        line.up.send(octets, arrived, None if publication.qos else acknowledged)
        return token

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None:
        self._ask(lambda now: self.session.subscribed({}, now))

    def unsubscribe(self, filters: Collection[str]) -> None:
        self._ask(self.session.unsubscribed)

    def _ask(self, tell: Callable[[float], None]) -> None:
        assert self._line is not None
        down = self._line.down.send
        self._line.up.send(PACKET, lambda: down(PACKET, lambda: self._now(tell)))

    def _accepted(self) -> None:
        self._is_accepted = True
        self._broker.connections += 1
        self._last_in = self._last_out = self._loop.clock()
        self._ping_at = 0.0
        self._timer = self._loop.after(1.0, self._look)
        self._now(lambda now: self.session.connected(Accepted(), now))

    def _ended(self, why: str, is_cut: bool = True) -> None:
        was_accepted = self._is_accepted
        self.drop()
        if was_accepted:
            self._now(lambda now: self.session.lost(why, now, is_cut))
        else:
            self._now(lambda now: self.session.failed(why, now))

    def _look(self) -> None:
        """paho's keep-alive: a ping when either way was silent for that long, the end when it is not answered."""
        now, line = self._loop.clock(), self._line
        assert line is not None
        self._timer = self._loop.after(1.0, self._look)
        if min(self._last_in, self._last_out) > now - self._keep_alive_s:
            return
        if self._ping_at:
            if now - self._ping_at >= self._keep_alive_s:
                self._ended("does not answer to PINGREQ", is_cut=False)
            return
        self._ping_at = self._last_out = now
        line.up.send(PACKET, lambda: line.down.send(PACKET, self._ponged))

    def _ponged(self) -> None:
        self._last_in, self._ping_at = self._loop.clock(), 0.0

    def _tell(self, tell: Callable[[float], None]) -> None:
        """Not from inside a call of the session."""
        self._loop.soon(lambda: self._now(tell))

    def _now(self, tell: Callable[[float], None]) -> None:
        tell(self._loop.clock())
        self.after()


class PlayedMqtt:
    """A chaos.processes.Program: what mqtt_client.py does around a session, on the station's loop."""

    def __init__(self, loop: Loop, say: Say, broker: Broker, jitter: Callable[[], float]) -> None:
        self.client: ModelClient
        self.session: Session | None = None
        self._loop = loop
        self._say = say
        self._broker = broker
        self._jitter = jitter
        self._timer: Timer | None = None
        self._due = float("inf")

    def take(self, message: bytes) -> None:
        if self.session is None:
            self._begin(settings(message))
        else:
            self.session.take(message, self._loop.clock())
        self._wait()

    def end(self) -> None:
        if self.session is not None:
            self.session.close(self._loop.clock())
        if self._timer is not None:
            self._timer.cancel()

    def _begin(self, wanted: MqttSettings) -> None:
        self.client = ModelClient(self._broker, wanted.client_id, wanted.keep_alive_s, wanted.stall_s)
        self.session = self.client.session = Session(
            wanted,
            profile_of(wanted),
            self.client,
            self._tell,
            self._jitter,
            lambda: UNIX_NS + int(self._loop.clock() * 1e9),
        )
        self.client.after = self._wait
        self.session.start(self._loop.clock())

    def _tell(self, message: bytes) -> bool:
        self._say(SAID_S, message)
        return True

    def _wait(self) -> None:
        """A timer for what the session has to do next; an earlier one is kept where it does no harm."""
        assert self.session is not None
        due = self.session.deadline()
        if self._timer is not None and self._timer.is_pending and self._due <= due:
            return
        if self._timer is not None:
            self._timer.cancel()
        if due != float("inf"):
            self._due = due
            self._timer = self._loop.after(max(0.0, due - self._loop.clock()), self._expire)

    def _expire(self) -> None:
        assert self.session is not None
        now = self._loop.clock()
        if self.session.deadline() <= now:
            self.session.expire(now)
        self._wait()


def played(broker: Broker, jitter: Callable[[], float]) -> Callable[[Loop, Say, PlayedChild], PlayedMqtt]:
    """What PlayedChild.programs holds for "mqtt"."""
    return lambda loop, say, child: PlayedMqtt(loop, say, broker, jitter)
