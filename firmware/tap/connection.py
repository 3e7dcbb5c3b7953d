"""Connection of a tap to its broker: shared subscriptions, reconnected after a loss.

It uses the MQTT client of the mqtt interface in the tool's loop. Unread messages wait in TCP, where the broker notices
them, instead of in a queue of the tool.
"""

import math
import random
import time
from collections.abc import Callable, Sequence

from board.runtime.errors import InterfaceError, StationError
from drivers.mqtt.broker import broker
from drivers.mqtt.client import trouble
from drivers.mqtt.client.backoff import Backoff
from drivers.mqtt.client.settings import MqttSettings
from drivers.mqtt.options import MqttOptions
from drivers.reason import Reason
from drivers.wire.v2n.message import Delivery, RefusedError

ANSWER_S = 10.0  # seconds for each of the broker's answers, unless given
# After UNSUBACK a broker still sends queued messages; after this silence, none are left.
DRAINED_S = 0.3
LEAVE_S = 5.0  # limit for leaving the broker altogether
# mosquitto's count of dropped messages of all clients since its start. Other brokers send none, or refuse the
# subscription.
DROPPED = "$SYS/broker/publish/messages/dropped"


class Connection:
    """Session with a broker on the drivers' Network (NetworkEvents): receives the deliveries of some topic filters.

    filters   topic filters with their quality of service.
    take      called with each delivery, in turn().
    refuse    called with each delivery that no profile could read.
    say       called with one line when the connection is lost, when a retry fails for a new reason, and after
              reconnection.
    answer_s  time limit in seconds, each for name, TCP, TLS and CONNACK together, and for SUBACK.
    counts    losses, gap_s (seconds without a connection), repeated (DUP), dropped (as the broker reports).
    """

    def __init__(
        self,
        settings: MqttOptions,
        filters: Sequence[tuple[str, int]],
        take: Callable[[Delivery], None],
        refuse: Callable[[RefusedError, Delivery], None],
        say: Callable[[str], None],
        answer_s: float = ANSWER_S,
    ) -> None:
        # paho-mqtt is imported on demand, so that other commands start without it.
        from drivers.mqtt.client.network import Network

        self.broker = broker(settings.url)
        self.counts = {"losses": 0.0, "gap_s": 0.0, "repeated": 0.0, "dropped": 0.0}
        self.is_up = False
        self._settings = MqttSettings(**vars(settings), connect_s=answer_s)
        self._filters = list(filters)
        self._take, self._refuse, self._say = take, refuse, say
        self._network = Network(self._settings, None)
        self._backoff = Backoff(self._settings.first_delay_s, self._settings.longest_delay_s, random.random)
        self._last_error = ""
        self._awaited = ""  # missing answer of the broker, as text, once it has accepted the connection
        self._retry_at = self._answer_by = math.inf
        self._lost_at = self._up_at = self._heard_at = 0.0
        self._dropped_before: float | None = None
        self._is_leaving = self._has_left = False

    @property
    def has_been_up(self) -> bool:
        return self._up_at > 0.0

    def open(self) -> None:
        """Connect and subscribe. Raises InterfaceError with the broker and the reason if it fails."""
        from drivers.mqtt.client.process import check

        check(self._settings)
        self._connect(time.monotonic())
        try:
            while not self.is_up:
                self.turn(0.1)
        finally:
            if not self.is_up:
                self._network.drop()

    def turn(self, longest_s: float) -> None:
        """Process deliveries; wait for them at most `longest_s`.

        Raises StationError for an error that a retry cannot remove.
        """
        network, now = self._network, time.monotonic()
        if now >= self._retry_at:
            self._connect(now)
        if now >= self._answer_by:
            awaited = self._awaited or network.waits_for
            network.drop()
            self.failed(f"{awaited} within {self._settings.connect_s:g} s", now)
        network.wait(self, min(self._retry_at, self._answer_by, now + longest_s))

    def leave(self) -> None:
        """Unsubscribe, receive the messages that the broker had queued, and disconnect."""
        self._is_leaving = True
        if self.is_up:
            self._network.unsubscribe([text for text, _ in self._filters])
            self._heard_at = time.monotonic()
            end = self._heard_at + LEAVE_S
            while self.is_up and time.monotonic() < end:
                self.turn(0.05)
                if self._has_left and time.monotonic() - self._heard_at > DRAINED_S:
                    break
        if self.is_up:
            self._network.disconnect()
            self._network.finish()
            self.is_up = False
        else:
            self._network.drop()

    def _connect(self, now: float) -> None:
        self._awaited = ""
        self._retry_at, self._answer_by = math.inf, now + self._settings.connect_s
        self._network.connect()

    # NetworkEvents: called by the network.

    def connected(self, accepted: object, now: float) -> None:
        self._awaited, self._answer_by = "no SUBACK", now + self._settings.connect_s
        self._network.subscribe(self._filters)

    def failed(self, why: str, now: float, is_away: bool = False) -> None:
        """Schedule a retry with back-off. Raises InterfaceError if the connection was never up."""
        self._answer_by = math.inf
        if not self.has_been_up:
            raise InterfaceError(f"{self.broker}: {why}")
        if why != self._last_error:
            self._say(f"captain: {self.broker}: {why}; trying again and again")
        self._last_error = why
        self._retry_at = now + self._backoff.failed(is_away)

    def lost(self, why: str, now: float, is_cut: bool = False, code: int = 0) -> None:
        """Schedule a reconnection. Raises StationError if another client has taken over the client_id."""
        if code == trouble.TAKEN_OVER:
            name = self._settings.client_id
            hint = "give each copy its own --client-id, or leave the option out"
            raise StationError(f"{self.broker}: another client has connected with the same client_id, {name}", hint)
        was_up, self.is_up = self.is_up, False
        if self._is_leaving:
            self._say(f"captain: {self.broker}: {why} while leaving")
        elif not was_up:
            self.failed(why, now)
        else:
            self.counts["losses"] += 1
            self._lost_at, self._last_error = now, why
            self._say(f"captain: {self.broker}: {why} (after {now - self._up_at:.1f} s); connecting again")
            self._retry_at = now + self._backoff.lost(was_good=True)

    def subscribed(self, refused: dict[str, str], now: float) -> None:
        if self.is_up:
            return  # answer to the subscription to DROPPED, which a broker may refuse
        if refused:
            self._network.drop()
            told = ", ".join(f"{text}: {words}" for text, words in refused.items())
            self.failed(f"refuses the subscription to {told}", now)
            return
        self.is_up, self._up_at, self._answer_by = True, now, math.inf
        self._backoff.reset()
        self._network.subscribe([(DROPPED, 0)])
        if self._lost_at:
            gap_s, self._lost_at = now - self._lost_at, 0.0
            self.counts["gap_s"] += gap_s
            self._say(f"captain: {self.broker}: connected again after {gap_s:.1f} s")

    def unsubscribed(self, now: float) -> None:
        self._has_left = True

    def published(self, token: int, why: str, now: float) -> None:
        """Do nothing: a tap publishes nothing."""

    def writable(self, now: float) -> None:
        """Do nothing: a tap has nothing to publish."""

    def received(self, delivery: Delivery, now: float) -> None:
        self._heard_at = now
        if delivery.topic == DROPPED:
            self._note_dropped(delivery.payload)
            return
        self.counts["repeated"] += delivery.is_repeated
        self._take(delivery)

    def drop(self, reason: Reason, sample: bytes, count: int = 1, why: str = "") -> None:
        self._heard_at = time.monotonic()
        self._refuse(RefusedError(reason, why), Delivery("", sample))

    def _note_dropped(self, payload: bytes) -> None:
        if not (payload.isdigit() and len(payload) < 20):
            return
        if self._dropped_before is None:
            self._dropped_before = float(payload)
        # A restarted broker counts from 0 again.
        self.counts["dropped"] = max(self.counts["dropped"], float(payload) - self._dropped_before)
