"""A station's session with a broker: when it connects and gives up, what it takes in, what the station is told.

Opens nothing and reads no clock: `Client` does the network, `take` brings what the station says, `say` tells it.
What cannot leave yet waits in the window (mqtt_window.py), and no more than fits: the station's queue has the rest.
"""

import math
from collections.abc import Callable, Collection
from enum import Enum, auto
from typing import Protocol

from board.errors import RequestError
from drivers.message import Ego, Position
from drivers.mqtt_backoff import STEADY_S, Backoff
from drivers.mqtt_broker import broker
from drivers.mqtt_echo import Echoes
from drivers.mqtt_report import Report
from drivers.mqtt_settings import MqttSettings
from drivers.mqtt_subscriptions import Subscriptions
from drivers.mqtt_window import Accepted, Window
from drivers.reason import Reason
from drivers.wire import v2n_talk as talk
from drivers.wire.v2n import Delivery, Profile, Publication, RefusedError

LOOK_S = 1.0  # between two changes of what is subscribed to: a vehicle at the edge of a tile goes to and fro

NOWHERE = Ego(0, Position(), is_known=False)


class Client(Protocol):
    """The network, as a session needs it. Each call returns at once; what comes of it is told to the session later."""

    @property
    def waits_for(self) -> str:
        """What a connection that is begun lacks, in words: "no answer to its SYN"."""

    @property
    def takes_more(self) -> bool:
        """Whether it has written all that it was given. Where it has not, Session.writable() is told later."""

    def connect(self, device: str) -> None:
        """Begin, by a network device where one is named; ends in Session.connected() or Session.failed()."""

    def disconnect(self) -> None:
        """Write what waits, say DISCONNECT, and close. Nothing is told of it."""

    def drop(self) -> None:
        """Close or give up without a word, so that the broker publishes the last will. Nothing is told of it."""

    def publish(self, publication: Publication) -> int:
        """A token; ends in Session.published(), or never if the connection is lost first."""

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None:
        """Ends in Session.subscribed()."""

    def unsubscribe(self, filters: Collection[str]) -> None:
        """Ends in Session.unsubscribed()."""


class Phase(Enum):
    """Of the connection."""

    BEARER = auto()  # there is none before the bearer is up
    PAUSE = auto()  # between two tries
    CONNECTING = auto()
    SUBSCRIBING = auto()  # it is accepted, the first subscriptions are not acknowledged
    UP = auto()
    CLOSED = auto()


_CONNECTED = frozenset({Phase.SUBSCRIBING, Phase.UP})


class Session:
    """One broker, as long as the process runs.

    say      as Report has it.
    jitter   as Backoff has it.
    unix_ns  Unix time.
    """

    def __init__(
        self,
        settings: MqttSettings,
        profile: Profile,
        client: Client,
        say: Callable[[bytes], bool],
        jitter: Callable[[], float],
        unix_ns: Callable[[], int],
    ) -> None:
        self.phase = Phase.BEARER
        self._settings = settings
        self._broker = broker(settings.url)
        self._profile = profile
        self._client = client
        self._report = Report(say, str(self._broker))
        self._backoff = Backoff(settings.first_delay_s, settings.longest_delay_s, jitter)
        self._unix_ns = unix_ns
        self._own = NOWHERE
        self._device = ""  # of the bearer
        self._accepted = Accepted()
        self._echoes = Echoes() if settings.version != 5 else None  # of version 5 noLocal is a part
        self._window = Window(self._publish, lambda: client.takes_more, self._report.tell, settings.max_in_flight)
        self._subscriptions = Subscriptions(client, self._wanted)
        self._since = 0.0  # the phase
        self._retry_at = self._look_at = self._beat_at = math.inf

    # The station's side.

    def start(self, now: float) -> None:
        self._beat_at = now + talk.BEAT_S
        self._begin(not self._settings.bearer, now)

    def take(self, message: bytes, now: float) -> None:
        """A message of the station, but for the settings."""
        match message[0]:
            case talk.SEND:
                self._send(talk.parse_send(message), now)
            case talk.EGO:
                before, self._own = self._own, talk.parse_ego(message)
                if self.phase in _CONNECTED:
                    self._look_at = min(self._look_at, now + LOOK_S if before.is_known else now)
            case talk.BEARER if self._settings.bearer and self.phase is not Phase.CLOSED:
                # Another address, or none: a connection from the old one hears nothing any more.
                self._client.drop()
                self._window.close()
                is_up, self._device = talk.parse_bearer(message)
                self._begin(is_up, now)

    def close(self, now: float) -> None:
        """Say good-bye. What the client has not written a moment later is lost."""
        if self.phase is Phase.UP:
            self._window.add_own(self._profile.closing(), now)
        self._client.disconnect()
        self._enter(Phase.CLOSED, now)
        self._report.counts(self._details())

    # The client's side.

    def connected(self, accepted: Accepted, now: float) -> None:
        """The broker has accepted the connection."""
        self._accepted = accepted
        self._report.tally.connections += 1
        self._enter(Phase.SUBSCRIBING, now)
        self._subscriptions.begin(accepted.is_resumed)
        self._subscriptions.follow(now)
        self._look(now)

    def failed(self, why: str, now: float, is_away: bool = False) -> None:
        """The connection did not come up. is_away: this machine has no network, and no broker was asked."""
        self._pause(why, now, self._backoff.failed(is_away))

    def lost(self, why: str, now: float, is_cut: bool = False) -> None:
        """The connection is gone that was accepted. is_cut: the network has cut it, and the broker did nothing."""
        was_good = self.phase is Phase.UP and (is_cut or now - self._since >= STEADY_S)
        self._pause(why, now, self._backoff.lost(was_good))

    def subscribed(self, refused: dict[str, str], now: float) -> None:
        """The broker has answered subscribe(). refused: filters that it does not deliver, and its words."""
        self._subscriptions.answered(refused, now)
        self._look(now)

    def unsubscribed(self, now: float) -> None:
        """The broker has answered unsubscribe()."""
        self._subscriptions.left(now)
        self._look(now)

    def published(self, token: int, why: str, now: float) -> None:
        """A publication was written (QoS 0) or acknowledged. why is empty, or why the broker refused it."""
        self._window.published_one(token, f"{self._broker}: {why}" if why else "", now)

    def writable(self, now: float) -> None:
        """The client takes more, which it did not."""
        self._window.flush(now)

    def received(self, delivery: Delivery, now: float) -> None:
        """What the broker delivered."""
        received_ns = self._unix_ns()
        try:
            found = self._profile.receive(delivery)
        except RefusedError as error:
            self.drop(error.reason, delivery.payload, why=error.message)
            return
        if self._echoes and not found.source and self._echoes.holds(delivery.topic, delivery.payload, now):
            self.drop(Reason.OWN_ECHO, found.pdu, why=f"{delivery.topic[:64]}: this station published it")
            return
        if self._profile.noted:
            self._report.tally.note(f"{delivery.topic[:64]}: {self._profile.noted}")
        self._report.tally.received += 1
        self._report.tell(talk.received(received_ns, found))

    def drop(self, reason: Reason, sample: bytes, count: int = 1, why: str = "") -> None:
        """Something received is not passed on: the station hears of it with the next beat. why: in words."""
        self._report.tally.drop(reason, sample, count, why)

    # Time.

    def deadline(self) -> float:
        """When expire() has something to do."""
        return min(self._retry_at, self._look_at, self._beat_at, self._window.deadline(), self._owed()[0])

    def expire(self, now: float) -> None:
        """Do what is due."""
        self._window.expire(now, self._report.why_down)
        overdue_at, why = self._owed()
        if now >= overdue_at:
            self._client.drop()
            ended = self.failed if self.phase is Phase.CONNECTING else self.lost
            ended(why, now)
        if now >= self._retry_at:
            self._connect(now)
        if now >= self._look_at:
            self._look_at = math.inf
            if self.phase in _CONNECTED:
                self._subscriptions.follow(now)
                self._look(now)
        if now >= self._beat_at:
            self._beat(now)

    def _owed(self) -> tuple[float, str]:
        """When it is too late for what the broker owes, and what that is."""
        limit_s, ack_s = self._settings.connect_s, 2.0 * self._settings.keep_alive_s
        if self.phase is Phase.CONNECTING:
            return self._since + limit_s, f"{self._client.waits_for} within {limit_s:g} s"
        if self.phase not in _CONNECTED:
            return math.inf, ""
        return min(self._subscriptions.owed(limit_s), self._window.owed(ack_s))

    # Connecting.

    def _begin(self, may_connect: bool, now: float) -> None:
        self._backoff.reset()
        self._report.link(False, "connects" if may_connect else "waits for its bearer")
        if may_connect:
            self._connect(now)
        else:
            self._enter(Phase.BEARER, now)

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase = phase
        self._since = now
        self._retry_at = math.inf

    def _connect(self, now: float) -> None:
        self._enter(Phase.CONNECTING, now)
        self._client.connect(self._device)

    def _pause(self, why: str, now: float, delay: float) -> None:
        self._window.close()
        self._enter(Phase.PAUSE, now)
        self._retry_at = now + delay
        self._report.tally.last_error = why
        self._report.link(False, why)

    def _look(self, now: float) -> None:
        """All that is wanted may be subscribed to by now: then the link is up, whatever is still to be left.

        Where nothing can be published for want of a position it is down: the policy has other ways.
        """
        if self.phase is Phase.SUBSCRIBING and (owed := self._subscriptions.awaits()) and owed[0] == "SUBACK":
            return
        if self.phase is Phase.SUBSCRIBING:
            self._enter(Phase.UP, now)
            self._window.open(self._accepted, str(self._broker), self._profile.connected(), now)
        is_useless, lacks = self._profile.lacks(self._own)
        if is_useless:
            self._report.link(False, lacks)
            return
        self._report.link(True, ", but ".join(filter(None, ("connected", lacks, self._subscriptions.lacks))))

    # Publishing.

    def _send(self, wanted: talk.ToSend, now: float) -> None:
        number, deadline, btp_port, row, pdu = wanted
        try:
            now_ms = self._unix_ns() // 1_000_000
            publications = self._profile.publications(self._settings.types[row], btp_port, pdu, self._own, now_ms)
        except RequestError as error:
            self._report.tell(talk.sent(number, Reason.SEND_FAILED, f"{self._broker}: {error.message}"))
            return
        if self._profile.missing:
            self._report.tally.publish_in_part(self._profile.missing)
        if deadline <= now:
            self._report.tell(talk.sent(number, Reason.EXPIRED))
        elif self._window.is_full():
            self._report.tell(talk.sent(number, Reason.QUEUE_FULL))
        else:
            self._window.add(number, deadline, publications, now)

    def _publish(self, publication: Publication, now: float) -> int:
        if self._echoes:
            self._echoes.add(publication.topic, publication.payload, now)
        return self._client.publish(publication)

    def _wanted(self) -> frozenset[tuple[str, int]]:
        return self._profile.subscriptions(self._own)

    # Telling.

    def _beat(self, now: float) -> None:
        self._beat_at = now + talk.BEAT_S
        if self.phase is Phase.UP:
            self._subscriptions.try_refused(now)
        self._report.beat(self._details())

    def _details(self) -> dict[str, object]:
        return {**self._window.details, **self._subscriptions.details}
