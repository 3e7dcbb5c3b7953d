"""Network of a session: connects by a Connector, then runs paho-mqtt on the socket.

Each connection has a new paho client: a client that reconnects would send unacknowledged publications again, even
outdated ones. The Connector is needed because paho would look up names and connect in the calling thread.
"""

import select
import time
from collections import deque
from collections.abc import Callable, Collection
from typing import Any

from paho.mqtt.client import ConnectFlags, DisconnectFlags, MQTTMessage
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from board.runtime.errors import InterfaceError, ProtocolError
from drivers.mqtt.client import trouble
from drivers.mqtt.client.backoff import STEADY_S
from drivers.mqtt.client.connector import Connector
from drivers.mqtt.client.events import NetworkEvents
from drivers.mqtt.client.line import MAX_PACKET, BrokerLine
from drivers.mqtt.client.paho import Paho, accepted_of, check_version, words_of
from drivers.mqtt.client.settings import MqttSettings
from drivers.mqtt.client.window import Accepted
from drivers.reason import Reason
from drivers.wire.mqtt_packets import Oversized
from drivers.wire.v2n.profile import Delivery, Publication

# Interval of the calls in which paho checks its keep-alive.
LOOK_S = 1.0

# Most acknowledgements that wait because the broker does not read. Beyond it, Network does not read from the broker.
MOST_OWED = 1000

# Changes of the last will after a refusal, by reason code of CONNACK (MQTT 5.0, clause 2.4). A broker without retained
# messages or QoS 1 announces that only by refusing the connection.
_OF_WILL: dict[int, dict[str, Any]] = {0x9A: {"retain": False}, 0x9B: {"qos": 0}}

Event = Callable[[NetworkEvents, float], None]


class Network:
    """Client of a session, with one socket at a time; turn() and wait() report NetworkEvents.

    will         last will: publication that the broker sends when the connection is lost.
    starts_anew  True: the first connection starts a clean session, because the subscriptions of an earlier process are
                 unknown.
    """

    def __init__(self, settings: MqttSettings, will: Publication | None, starts_anew: bool = False) -> None:
        self._settings = settings
        self._will = will
        self._starts_anew = starts_anew
        self._connector: Connector | None = None
        self._paho: Paho | None = None
        self._is_accepted = False
        self._accepted_at = 0.0
        self._asked: list[str] = []
        self._owed = 0
        self._is_awaited = False  # the session waits for writable()
        self._look_at = 0.0
        # paho's callbacks only add events here. So an exception inside paho is never an error of this project's code.
        self._events: deque[Event] = deque()

    # session.Client.

    @property
    def waits_for(self) -> str:
        return self._connector.waits_for if self._connector else "no CONNACK"

    @property
    def takes_more(self) -> bool:
        paho = self._paho
        self._is_awaited = paho is None or paho.want_write() or not paho.line.has_room
        return not self._is_awaited

    def connect(self, device: str = "") -> None:
        self._connector = Connector(self._settings, device)

    def disconnect(self) -> None:
        paho = self._paho
        if paho is None or not self._is_accepted:
            self.drop()
        else:
            paho.disconnect()

    def drop(self) -> None:
        self._events.clear()
        self._is_accepted = self._is_awaited = False
        if self._connector is not None:
            connector, self._connector = self._connector, None
            connector.close()
            if connector.socket is not None:
                connector.socket.close()
        if self._paho is not None:
            paho, self._paho = self._paho, None
            paho.line.discard()

    def publish(self, publication: Publication) -> int:
        return self._connected().send(publication)

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None:
        self._asked = [name for name, _ in filters]
        self._connected().subscribe_to(filters)

    def unsubscribe(self, filters: Collection[str]) -> None:
        self._connected().unsubscribe(list(filters))

    # The loop of the process.

    def wants(self) -> tuple[list[int], list[int]]:
        """Return the descriptors to wait for: those to read from, and those to write to."""
        if self._connector is not None:
            return [self._connector.fileno()], []
        paho = self._paho
        if paho is None:
            return [], []
        reads = [] if self._owed > MOST_OWED else [paho.line.fileno()]
        return reads, [paho.line.fileno()] if paho.want_write() or self._is_awaited else []

    @property
    def has_more(self) -> bool:
        """Whether turn() has work without waiting."""
        return bool(self._events) or (self._paho is not None and self._paho.line.has_more)

    def deadline(self) -> float:
        return self._look_at if self._paho is not None else float("inf")

    def turn(self, user: NetworkEvents, now: float, is_readable: bool) -> None:
        """Do all work that does not block, and report its events to the user.

        is_readable  True if a descriptor of wants() is readable.
        """
        if self._connector is not None:
            self._connect_ended(user, now)
        elif self._paho is not None:
            self._exchange(self._paho, now, is_readable or self._paho.line.has_more)
        self._tell(user, now)
        if self._is_awaited and self.takes_more:
            user.writable(now)

    def wait(self, user: NetworkEvents, due: float) -> None:
        """Wait until turn() has work, or until the time `due`, then call it; for a user without other descriptors."""
        reads, writes = self.wants()
        left = 0.0 if self.has_more else min(due, self.deadline()) - time.monotonic()
        ready, _, _ = select.select(reads, writes, [], max(0.0, left))
        self.turn(user, time.monotonic(), bool(ready))

    def finish(self) -> None:
        """Wait after disconnect() until all is written and the broker has closed, at most for a moment."""
        if self._paho is not None:
            self._paho.finish()
            self.drop()

    def _connect_ended(self, user: NetworkEvents, now: float) -> None:
        connector = self._connector
        if connector is None or (connector.socket is None and not connector.why_not):
            return
        self._connector = None
        connector.close()
        if connector.socket is None:
            user.failed(connector.why_not, now, connector.is_away)
            return
        try:
            self._paho = paho = Paho(BrokerLine(connector.socket), self._settings, self._starts_anew)
            self._listen(paho)
            paho.send_connect(self._will)
        except InterfaceError as error:
            self.drop()
            user.failed(trouble.why(error), now)
        self._look_at = now + LOOK_S

    def _listen(self, paho: Paho) -> None:
        paho.on_connect = self._on_connect
        paho.on_disconnect = self._on_disconnect
        paho.on_message = self._on_message
        paho.on_publish = self._on_publish
        paho.on_subscribe = self._on_subscribe
        paho.on_unsubscribe = self._on_unsubscribe
        self._owed = 0

    def _exchange(self, paho: Paho, now: float, is_readable: bool) -> None:
        """Read, write, and let paho check its keep-alive; queue an event if the connection has ended."""
        try:
            for packet in paho.line.read() if is_readable else ():
                if isinstance(packet, Oversized):
                    self._oversized(packet)
                    continue
                check_version(packet)
                paho.line.put(packet)
                while paho.line.has_packets and not paho.line.is_closed:
                    paho.loop_read()
            if paho.want_write():
                paho.loop_write()
            if now >= self._look_at:
                self._look_at = now + LOOK_S
                paho.loop_misc()
            if not paho.want_write():
                self._owed = 0
        except (OSError, EOFError, ProtocolError) as error:
            self._ended(trouble.why(error), trouble.is_cut(error))
        except Exception as error:  # noqa: BLE001 paho raises exceptions of any type for invalid octets
            self._ended(f"sends invalid MQTT: {type(error).__name__}: {error}")

    def _tell(self, user: NetworkEvents, now: float) -> None:
        """Report all queued events to the user; its reactions may add events."""
        while self._events:
            self._events.popleft()(user, now)

    def _connected(self) -> Paho:
        assert self._paho is not None
        return self._paho

    def _ended(self, why: str, is_cut: bool = False, code: int = 0) -> None:
        self._events.append(lambda user, now: self._over(user, why, is_cut, code, now))

    def _over(self, user: NetworkEvents, why: str, is_cut: bool, code: int, now: float) -> None:
        paho = self._paho
        if paho is not None and (cause := paho.line.cause()) is not None:
            why, is_cut, code = trouble.why(cause), trouble.is_cut(cause), 0
        was_accepted = self._is_accepted
        self.drop()
        if was_accepted:
            why = trouble.soon(why) if now - self._accepted_at < STEADY_S else why
            user.lost(why, now, is_cut, code)
        else:
            user.failed(trouble.early(why, self._settings), now)

    # paho's callbacks.

    def _on_connect(
        self, _: Any, __: Any, flags: ConnectFlags, code: ReasonCode, properties: Properties | None
    ) -> None:
        if code.is_failure:
            if self._will is not None and code.value in _OF_WILL:
                self._will = self._will._replace(**_OF_WILL[code.value])  # for the next try
            self._ended(f"refuses the connection: {trouble.refusal(str(code), words_of(properties), True)}")
            return
        accepted = accepted_of(flags, properties)
        self._events.append(lambda user, now: self._accept(user, accepted, now))

    def _accept(self, user: NetworkEvents, accepted: Accepted, now: float) -> None:
        self._is_accepted = True
        self._starts_anew = False
        self._accepted_at = now
        user.connected(accepted, now)

    def _on_disconnect(
        self, _: Any, __: Any, flags: DisconnectFlags, code: ReasonCode, properties: Properties | None
    ) -> None:
        if flags.is_disconnect_packet_from_server:
            why = f"ends the connection: {trouble.refusal(str(code), words_of(properties))}"
            self._ended(why, code=code.value)
        elif str(code) == "Keep alive timeout":
            self._ended("does not answer to PINGREQ")
        else:
            self._ended(f"sends invalid MQTT: {code}")

    def _on_message(self, _: Any, __: Any, message: MQTTMessage) -> None:
        self._events.append(lambda user, now: self._deliver(user, message, now))

    def _on_publish(self, _: Any, __: Any, mid: int, code: ReasonCode, properties: Properties | None) -> None:
        why = f"refuses it: {trouble.refusal(str(code), words_of(properties))}" if code.is_failure else ""
        self._events.append(lambda user, now: user.published(mid, why, now))

    def _on_subscribe(self, _: Any, __: Any, mid: int, codes: list[ReasonCode], properties: Properties | None) -> None:
        words = words_of(properties)
        refused = {
            name: trouble.refusal(str(code), words)
            for name, code in zip(self._asked, codes, strict=False)
            if code.is_failure
        }
        refused |= dict.fromkeys(self._asked[len(codes) :], "the broker's SUBACK has no reason code for this topic")
        self._events.append(lambda user, now: user.subscribed(refused, now))

    def _on_unsubscribe(self, *_: Any) -> None:
        self._events.append(lambda user, now: user.unsubscribed(now))

    # Received messages.

    def _deliver(self, user: NetworkEvents, message: MQTTMessage, now: float) -> None:
        payload = bytes(message.payload)
        try:
            topic = message.topic
        except UnicodeDecodeError as error:
            user.drop(Reason.TOPIC, payload, why=f"topic {error.object[:32]!r} is not UTF-8")
        else:
            user.received(Delivery(topic, payload, message.retain, message.dup), now)
        if message.qos:  # acknowledged only after delivery, because the broker may delete an acknowledged message
            self._acknowledge(message.mid)

    def _oversized(self, packet: Oversized) -> None:
        if packet.number:
            self._acknowledge(packet.number)
        why = f"the packet is longer than {MAX_PACKET} octets"
        self._events.append(lambda user, now: user.drop(Reason.PAYLOAD, packet.sample, why=why))

    def _acknowledge(self, number: int) -> None:
        paho = self._paho
        if paho is not None:
            paho.ack(number, 1)
            self._owed += paho.want_write()
