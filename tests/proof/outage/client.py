"""MQTT process in virtual time, with the real session.

The model of a connection has what costs time: a handshake is three ways and two, an acknowledgement one. The
keep-alive is paho's.
"""

from collections.abc import Callable, Collection

from board.runtime.loop import Loop, Timer
from drivers.mqtt.client.process import profile_of
from drivers.mqtt.client.session import Session
from drivers.mqtt.client.settings import MqttSettings, settings_in
from drivers.mqtt.client.window import Accepted
from drivers.wire.v2n.profile import Profile, Publication
from tests.proof.chaos.processes import PlayedChild, Say
from tests.proof.outage.broker import Broker
from tests.proof.outage.network import Line

# Octets: TLS 1.3 with a certificate of each end; an MQTT packet but for topic and payload, in its TLS record.
HELLO, CERTIFICATES, ANSWER = 300, 2500, 1500
PACKET = 35

SAID_S = 0.0002  # from the child to the station
UNIX_NS = 1_800_000_000_000_000_000  # at loop time 0


class ModelClient:
    """session.Client, as network.Network is one. starts_anew: as that has it."""

    def __init__(self, broker: Broker, wanted: MqttSettings, starts_anew: bool) -> None:
        self.session: Session
        self.after: Callable[[], None] = lambda: None  # called when the session was told something
        self.waits_for = "no answer to SYN"
        self._broker = broker
        self._loop = broker.loop
        self._wanted = wanted
        self._name = wanted.client_id
        self._starts_anew = starts_anew
        self._line: Line | None = None
        self._is_accepted = False
        self._tokens = 0
        self._timer: Timer | None = None

    @property
    def takes_more(self) -> bool:
        return self._line is not None and self._line.up.is_writable

    def connect(self, device: str = "") -> None:
        self.drop()
        network = self._broker.network
        if not network.is_attached:
            self._tell(lambda now: self.session.failed("no route to it", now, is_away=True))
            return
        self.waits_for = "no answer to SYN"
        line = self._line = Line(network, self._wanted.stall_s, self._ended)
        line.up.on_room = lambda: self._now(self.session.writable)
        up, down, wanted = line.up.send, line.down.send, self._wanted

        def greeted() -> None:
            self.waits_for = "no answer to the TLS handshake"
            up(HELLO, lambda: down(CERTIFICATES, shown))

        def shown() -> None:
            self.waits_for = "no CONNACK"
            up(ANSWER + PACKET, asked)

        def asked() -> None:
            # A broker takes a connection for lost after one and a half of its keep-alive (MQTT 5.0, clause 3.1.2.10).
            forgets_s = 1.5 * wanted.keep_alive_s + wanted.session_expiry_s
            accepted = self._broker.accept(self._name, wanted.clean or self._starts_anew, forgets_s)
            down(PACKET, lambda: self._accepted(accepted))

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
        line, broker = self._line, self._broker
        assert line is not None
        assert self._is_accepted
        self._tokens += 1
        token = self._tokens
        self._last_out = self._loop.clock()
        kept = broker.kept[self._name]
        octets = PACKET + len(publication.topic) + len(publication.payload)

        def acknowledged() -> None:
            self._last_in = now = self._loop.clock()
            self.session.published(token, "", now)
            self.after()

        def taken() -> None:
            broker.left(self._name, kept.connections, publication)
            if not publication.qos:
                self._loop.soon(acknowledged)

        def arrived() -> None:
            kept.seen = self._loop.clock()
            broker.arrived(self._name, publication)
            if publication.qos:
                line.down.send(PACKET, acknowledged)

        line.up.send(octets, arrived, taken)
        return token

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None:
        names = [name for name, _ in filters]
        held = self._broker.kept[self._name].filters
        self._ask(names, lambda: held.update(names), lambda now: self.session.subscribed({}, now))

    def unsubscribe(self, filters: Collection[str]) -> None:
        held = self._broker.kept[self._name].filters
        self._ask(filters, lambda: held.difference_update(filters), self.session.unsubscribed)

    def _ask(self, filters: Collection[str], act: Callable[[], None], tell: Callable[[float], None]) -> None:
        assert self._line is not None
        down = self._line.down.send

        def arrived() -> None:
            act()
            down(PACKET, lambda: self._now(tell))

        self._line.up.send(PACKET + sum(map(len, filters)), arrived)

    def _accepted(self, accepted: Accepted) -> None:
        self._is_accepted = True
        self._starts_anew = False
        self._last_in = self._last_out = self._loop.clock()
        self._ping_at = 0.0
        self._timer = self._loop.after(1.0, self._look)
        self._now(lambda now: self.session.connected(accepted, now))

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
        if min(self._last_in, self._last_out) > now - self._wanted.keep_alive_s:
            return
        if self._ping_at:
            if now - self._ping_at >= self._wanted.keep_alive_s:
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
    """A chaos.processes.Program: what mqtt/client/process.py does around a session, on the station's loop."""

    def __init__(self, loop: Loop, say: Say, broker: Broker, jitter: Callable[[], float]) -> None:
        self.client: ModelClient
        self.profile: Profile
        self.session: Session | None = None
        self._loop = loop
        self._say = say
        self._broker = broker
        self._jitter = jitter
        self._timer: Timer | None = None
        self._due = float("inf")

    def take(self, message: bytes) -> None:
        if self.session is None:
            self._begin(settings_in(message))
        else:
            self.session.take(message, self._loop.clock())
        self._wait()

    def end(self) -> None:
        if self.session is not None:
            self.session.close(self._loop.clock())
        if self._timer is not None:
            self._timer.cancel()

    def _begin(self, wanted: MqttSettings) -> None:
        self.profile = profile_of(wanted)
        self.client = ModelClient(self._broker, wanted, starts_anew=self.profile.moves)
        self.session = self.client.session = Session(
            wanted,
            self.profile,
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
