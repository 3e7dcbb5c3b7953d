"""MQTT session: connects, subscribes and publishes for a station, and reports its link.

Opens nothing and reads no clock: `Client` does the network, take() gets the station's messages, `say` reports to it.

State table:

# phase        meaning                               event                                      -> phase
#
# BEARER       the bearer is down                    talk.BEARER: up                               CONNECTING
#                                                    start(), if no bearer is configured           CONNECTING
# PAUSE        back-off between two tries            the delay expires                             CONNECTING
# CONNECTING   waits for the broker's CONNACK        connected()                                   SUBSCRIBING
#                                                    failed(), or connect_s expires                PAUSE
# SUBSCRIBING  waits for the first SUBACKs           subscribed(), unsubscribed(): none is missing UP
# both         connected                             lost(), or an acknowledgement is overdue      PAUSE
# UP           publications are sent, the link is up
# any          talk.BEARER -> BEARER if it is down, else CONNECTING through its device. close() -> CLOSED, for good

The process calls start(), take(), expire() and close(). The client (network.py) calls the methods below `The client's
side`: connected() ... drop(); all of them except drop() have the current time as a parameter. All calls are made in one
thread, and none blocks. A call of `Client` returns at once and never calls the session from inside.

A publication that cannot be sent yet waits in the bounded window (window.py); more requests wait in the station's
queue. Publications are not passed to paho early, because paho does not expire them. Earlier, a broker that resumed
reading got messages that had been reported as expired. At each PAUSE unacknowledged publications return to the window
until their deadline, so every request is answered exactly once.

The link is up only in UP, and only while the profile can publish. Earlier, a profile that publishes by tile was up
without a position, so the fallback of the policy was never used. UNSUBACK ends SUBSCRIBING as SUBACK does. Earlier, a
vehicle that changed tile during SUBSCRIBING never left that phase. After a connection that the network cut, or that was
up for STEADY_S, the first delay is used. Earlier, each road tunnel doubled the delay; 19 of 36 handovers in an hour
were unfinished when the next one began.
"""

import math
from collections.abc import Callable, Collection
from enum import Enum, auto
from typing import Protocol

from board.runtime.errors import RequestError
from drivers.message import Ego, Position
from drivers.mqtt.broker import broker
from drivers.mqtt.client.backoff import STEADY_S, Backoff
from drivers.mqtt.client.echo import Echoes
from drivers.mqtt.client.report import Report
from drivers.mqtt.client.settings import MqttSettings
from drivers.mqtt.client.subscriptions import Subscriptions
from drivers.mqtt.client.window import Accepted, Window
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.profile import Delivery, Profile, Publication, RefusedError

LOOK_S = 1.0  # shortest interval between changes of subscriptions, for a vehicle that moves along the edge of a tile

NOWHERE = Ego(0, Position(), is_known=False)


class Client(Protocol):
    """Network client of a session. Each call returns at once; the client reports its result to the session later."""

    @property
    def waits_for(self) -> str:
        """Missing step of the current try to connect, in words, such as "no answer to SYN from 192.0.2.1"."""

    @property
    def takes_more(self) -> bool:
        """Whether the client has written all octets. If it has not, it calls Session.writable() later."""

    def connect(self, device: str) -> None:
        """Start to connect; the result is Session.connected() or Session.failed().

        device  network device to use; empty: any.
        """

    def disconnect(self) -> None:
        """Write waiting octets, send DISCONNECT, and close. It causes no report."""

    def drop(self) -> None:
        """Close without DISCONNECT, so that the broker publishes the last will. It causes no report."""

    def publish(self, publication: Publication) -> int:
        """Publish; return a token, which Session.published() repeats, unless the connection is lost before."""

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None:
        """Subscribe to topic filters, each with its QoS; the result is Session.subscribed()."""

    def unsubscribe(self, filters: Collection[str]) -> None:
        """Unsubscribe from topic filters; the result is Session.unsubscribed()."""


class Phase(Enum):
    """Phase of the connection; the module's docstring has the state table."""

    BEARER = auto()  # waits for the bearer
    PAUSE = auto()  # waits between two tries
    CONNECTING = auto()
    SUBSCRIBING = auto()  # the broker has accepted the connection, but not yet acknowledged the first subscriptions
    UP = auto()
    CLOSED = auto()


_CONNECTED = frozenset({Phase.SUBSCRIBING, Phase.UP})


class Session:
    """Session with one broker, for the lifetime of the process.

    say      passes a message to the outbox, see Report.
    jitter   random number from 0 to 1, see Backoff.
    unix_ns  function that returns Unix time in nanoseconds.
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
        self._device = ""  # network device of the bearer
        self._accepted = Accepted()
        self._echoes = Echoes() if settings.version != 5 else None  # MQTT 5.0 has noLocal instead
        self._window = Window(self._publish, lambda: client.takes_more, self._report.send, settings.max_in_flight)
        self._subscriptions = Subscriptions(client, self._wanted)
        self._since = 0.0  # start of the current phase
        self._retry_at = self._look_at = self._beat_at = math.inf

    # The station's side.

    def start(self, now: float) -> None:
        self._beat_at = now + talk.BEAT_S
        self._begin(not self._settings.bearer, now)

    def take(self, message: bytes, now: float) -> None:
        """Handle a message of the station, other than the settings."""
        match message[0]:
            case talk.SEND:
                self._send(talk.parse_send(message), now)
            case talk.EGO:
                before, self._own = self._own, talk.parse_ego(message)
                if self.phase in _CONNECTED:
                    self._look_at = min(self._look_at, now + LOOK_S if before.is_known else now)
            case talk.BEARER if self._settings.bearer and self.phase is not Phase.CLOSED:
                # The bearer has another address now, or none, so a connection from the old address is dead.
                self._client.drop()
                self._window.close()
                is_up, self._device = talk.parse_bearer(message)
                self._begin(is_up, now)

    def close(self, now: float) -> None:
        """Publish the profile's closing messages, and disconnect. Publications not written soon are lost."""
        if self.phase is Phase.UP:
            self._window.add_own(self._profile.closing(), now)
        self._client.disconnect()
        self._enter(Phase.CLOSED, now)
        self._report.counts(self._details())

    # The client's side.

    def connected(self, accepted: Accepted, now: float) -> None:
        """Subscribe, after the broker has accepted the connection."""
        self._accepted = accepted
        self._report.tally.connections += 1
        self._enter(Phase.SUBSCRIBING, now)
        self._subscriptions.begin(accepted.is_resumed)
        self._subscriptions.follow(now)
        self._look(now)

    def failed(self, why: str, now: float, is_away: bool = False) -> None:
        """Wait for the next try, after a failed one; is_away: this machine has no network."""
        self._pause(why, now, self._backoff.failed(is_away))

    def lost(self, why: str, now: float, is_cut: bool = False, code: int = 0) -> None:
        """Wait for the next try, after the loss of an accepted connection; is_cut: the network has cut it."""
        was_good = self.phase is Phase.UP and (is_cut or now - self._since >= STEADY_S)
        self._pause(why, now, self._backoff.lost(was_good))

    def subscribed(self, refused: dict[str, str], now: float) -> None:
        """Take note of the answer to subscribe(); refused: refused filters, with the broker's reasons in words."""
        self._subscriptions.answered(refused, now)
        self._look(now)

    def unsubscribed(self, now: float) -> None:
        """Take note of the answer to unsubscribe()."""
        self._subscriptions.left(now)
        self._look(now)

    def published(self, token: int, why: str, now: float) -> None:
        """Take note that a publication was written (QoS 0), acknowledged or refused; why: the reason of a refusal."""
        self._window.published_one(token, f"{self._broker}: {why}" if why else "", now)

    def writable(self, now: float) -> None:
        """Send waiting publications, after the client accepts more again."""
        self._window.flush(now)

    def received(self, delivery: Delivery, now: float) -> None:
        """Pass a delivered message to the station, or count it as dropped."""
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
        self._report.send(talk.received(received_ns, found))

    def drop(self, reason: Reason, sample: bytes, count: int = 1, why: str = "") -> None:
        """Count discarded messages, which the next beat reports to the station; why: explanation in words."""
        self._report.tally.drop(reason, sample, count, why)

    # Time.

    def deadline(self) -> float:
        """Return the time of the next expire()."""
        return min(self._retry_at, self._look_at, self._beat_at, self._window.deadline(), self._owed()[0])

    def expire(self, now: float) -> None:
        """Execute everything that is due: expired requests, timeouts, retries, changes of subscriptions, beats."""
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
        """Return the deadline of the broker's next answer, and the reason in words if it is missed."""
        limit_s, ack_s = self._settings.connect_s, 2.0 * self._settings.keep_alive_s
        if self.phase is Phase.CONNECTING:
            return self._since + limit_s, f"{self._client.waits_for} within {limit_s:g} s"
        if self.phase not in _CONNECTED:
            return math.inf, ""
        return min(self._subscriptions.owed(limit_s), self._window.owed(ack_s))

    # Connecting.

    def _begin(self, may_connect: bool, now: float) -> None:
        self._backoff.reset()
        self._report.link(False, "connecting" if may_connect else "waits for its bearer", is_starting=True)
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
        """Enter UP if all subscriptions are acknowledged, even while an unsubscription is not; report the link.

        The link is reported down while the profile cannot publish without a position. The policy may then use other
        interfaces.
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
            publications = self._profile.publications(self._settings.type_of(row), btp_port, pdu, self._own, now_ms)
        except RequestError as error:
            self._report.send(talk.sent(number, Reason.SEND_FAILED, f"{self._broker}: {error.message}"))
            return
        if self._profile.missing:
            self._report.tally.publish_in_part(self._profile.missing)
        if deadline <= now:
            self._report.send(talk.sent(number, Reason.EXPIRED))
        elif self._window.is_full():
            self._report.send(talk.sent(number, Reason.QUEUE_FULL))
        else:
            self._window.add(number, deadline, publications, now)

    def _publish(self, publication: Publication, now: float) -> int:
        if self._echoes:
            self._echoes.add(publication.topic, publication.payload, now)
        return self._client.publish(publication)

    def _wanted(self) -> frozenset[tuple[str, int]]:
        return self._profile.subscriptions(self._own)

    # Reports.

    def _beat(self, now: float) -> None:
        self._beat_at = now + talk.BEAT_S
        if self.phase is Phase.UP:
            self._subscriptions.try_refused(now)
        self._report.beat(self._details())

    def _details(self) -> dict[str, object]:
        return {**self._window.details, **self._subscriptions.details}
