"""paho-mqtt as the client of a session: a new one for each connection, so that nothing of an earlier one is sent.

paho keeps what was not acknowledged and sends it all again at a reconnect, stale or not. It also connects and
looks names up where it is called; a Connector has done that before paho gets the socket.
"""

from collections import deque
from collections.abc import Callable, Collection
from typing import Any

from paho.mqtt.client import ConnectFlags, DisconnectFlags, MQTTMessage
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode
from paho.mqtt.subscribeoptions import SubscribeOptions

from board.errors import InterfaceError, ProtocolError
from drivers import mqtt_trouble
from drivers.mqtt_backoff import STEADY_S
from drivers.mqtt_connector import Connector
from drivers.mqtt_line import MAX_PACKET, Line
from drivers.mqtt_paho import Paho, accepted_of, check_version, words_of
from drivers.mqtt_session import Session
from drivers.mqtt_settings import MqttSettings
from drivers.mqtt_window import Accepted
from drivers.reason import Reason
from drivers.wire.mqtt_packets import Oversized
from drivers.wire.v2n import Delivery, Publication

# paho looks at its keep-alive when it is asked to.
LOOK_S = 1.0

# Acknowledgements that wait because the broker reads nothing: then it is not read from either.
MOST_OWED = 1000

# What a broker has not that the last will asks for (MQTT 5.0, clause 2.4): it says so only when it refuses.
_OF_WILL: dict[int, dict[str, Any]] = {0x9A: {"retain": False}, 0x9B: {"qos": 0}}


class Network:
    """mqtt_session.Client on one socket at a time.

    will         what the broker publishes when the connection is lost.
    starts_anew  the first connection leaves what an earlier process was subscribed to, which nobody here knows.
    """

    def __init__(self, settings: MqttSettings, will: Publication | None, starts_anew: bool = False) -> None:
        self.session: Session
        self._settings = settings
        self._will = will
        self._starts_anew = starts_anew
        self._is_5 = settings.version == 5
        self._connector: Connector | None = None
        self._paho: Paho | None = None
        self._is_accepted = False
        self._accepted_at = 0.0
        self._asked: list[str] = []
        self._owed = 0
        self._is_awaited = False  # by the session, to take more
        self._look_at = 0.0
        # paho's callbacks only put something here: what paho raises is never an error of ours.
        self._events: deque[Callable[[float], None]] = deque()

    # mqtt_session.Client.

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
        if self._is_5:
            self._connected().subscribe([(name, SubscribeOptions(qos, noLocal=True)) for name, qos in filters])
        else:
            self._connected().subscribe(list(filters))

    def unsubscribe(self, filters: Collection[str]) -> None:
        self._connected().unsubscribe(list(filters))

    # The loop of the process.

    def wants(self) -> tuple[list[int], list[int]]:
        """Descriptors that are waited for, to read from and to write to."""
        if self._connector is not None:
            return [self._connector.fileno()], []
        paho = self._paho
        if paho is None:
            return [], []
        reads = [] if self._owed > MOST_OWED else [paho.line.fileno()]
        return reads, [paho.line.fileno()] if paho.want_write() or self._is_awaited else []

    @property
    def has_more(self) -> bool:
        """Whether something is there to be done at once."""
        return bool(self._events) or (self._paho is not None and self._paho.line.has_more)

    def deadline(self) -> float:
        return self._look_at if self._paho is not None else float("inf")

    def turn(self, now: float, is_readable: bool) -> None:
        """Do what can be done without waiting. is_readable: one of the descriptors to read from is."""
        if self._connector is not None:
            self._connect_ended(now)
        elif self._paho is not None:
            self._exchange(self._paho, now, is_readable or self._paho.line.has_more)
        self._tell(now)
        if self._is_awaited and self.takes_more:
            self.session.writable(now)

    def finish(self) -> None:
        """After disconnect(): until it is written and the broker has closed, or for a moment."""
        if self._paho is not None:
            self._paho.finish()
            self.drop()

    def _connect_ended(self, now: float) -> None:
        connector = self._connector
        if connector is None or (connector.socket is None and not connector.why_not):
            return
        self._connector = None
        connector.close()
        if connector.socket is None:
            self.session.failed(connector.why_not, now, connector.is_away)
            return
        try:
            self._paho = paho = Paho(Line(connector.socket), self._settings, self._starts_anew)
            self._listen(paho)
            paho.greet(self._will)
        except InterfaceError as error:
            self.drop()
            self.session.failed(mqtt_trouble.why(error), now)
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
        """Read, write, and let paho look at its clock; or tell why that is over."""
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
            self._ended(mqtt_trouble.why(error), mqtt_trouble.is_cut(error))
        except Exception as error:  # noqa: BLE001 paho meets octets that it does not expect
            self._ended(f"sends what is no MQTT: {type(error).__name__}: {error}")

    def _tell(self, now: float) -> None:
        """Tell the session what has happened; it may make more happen."""
        while self._events:
            self._events.popleft()(now)

    def _connected(self) -> Paho:
        assert self._paho is not None
        return self._paho

    def _ended(self, why: str, is_cut: bool = False) -> None:
        self._events.append(lambda now: self._over(why, is_cut, now))

    def _over(self, why: str, is_cut: bool, now: float) -> None:
        paho = self._paho
        if paho is not None and (cause := paho.line.cause()) is not None:
            why, is_cut = mqtt_trouble.why(cause), mqtt_trouble.is_cut(cause)
        was_accepted = self._is_accepted
        self.drop()
        if was_accepted:
            why = mqtt_trouble.soon(why) if now - self._accepted_at < STEADY_S else why
            self.session.lost(why, now, is_cut)
        else:
            self.session.failed(mqtt_trouble.early(why, self._settings), now)

    # paho's callbacks.

    def _on_connect(
        self, _: Any, __: Any, flags: ConnectFlags, code: ReasonCode, properties: Properties | None
    ) -> None:
        if code.is_failure:
            if self._will is not None and code.value in _OF_WILL:
                self._will = self._will._replace(**_OF_WILL[code.value])  # the next try has another
            self._ended(f"refuses the connection: {mqtt_trouble.refusal(str(code), words_of(properties), True)}")
            return
        accepted = accepted_of(flags, properties)
        self._events.append(lambda now: self._accept(accepted, now))

    def _accept(self, accepted: Accepted, now: float) -> None:
        self._is_accepted = True
        self._starts_anew = False
        self._accepted_at = now
        self.session.connected(accepted, now)

    def _on_disconnect(
        self, _: Any, __: Any, flags: DisconnectFlags, code: ReasonCode, properties: Properties | None
    ) -> None:
        if flags.is_disconnect_packet_from_server:
            self._ended(f"ends the connection: {mqtt_trouble.refusal(str(code), words_of(properties))}")
        elif str(code) == "Keep alive timeout":
            self._ended("does not answer to PINGREQ")
        else:
            self._ended(f"sends what is no MQTT: {code}")

    def _on_message(self, _: Any, __: Any, message: MQTTMessage) -> None:
        self._events.append(lambda now: self._deliver(message, now))

    def _on_publish(self, _: Any, __: Any, mid: int, code: ReasonCode, properties: Properties | None) -> None:
        why = f"refuses it: {mqtt_trouble.refusal(str(code), words_of(properties))}" if code.is_failure else ""
        self._events.append(lambda now: self.session.published(mid, why, now))

    def _on_subscribe(self, _: Any, __: Any, mid: int, codes: list[ReasonCode], properties: Properties | None) -> None:
        words = words_of(properties)
        refused = {
            name: mqtt_trouble.refusal(str(code), words)
            for name, code in zip(self._asked, codes, strict=False)
            if code.is_failure
        }
        refused |= dict.fromkeys(self._asked[len(codes) :], "its SUBACK says nothing of it")
        self._events.append(lambda now: self.session.subscribed(refused, now))

    def _on_unsubscribe(self, *_: Any) -> None:
        self._events.append(self.session.unsubscribed)

    # What was received.

    def _deliver(self, message: MQTTMessage, now: float) -> None:
        if message.qos:
            self._acknowledge(message.mid)
        try:
            topic = message.topic
        except UnicodeDecodeError as error:
            self.session.drop(Reason.TOPIC, bytes(message.payload), why=f"topic {error.object[:32]!r} is not UTF-8")
            return
        self.session.received(Delivery(topic, bytes(message.payload), message.retain), now)

    def _oversized(self, packet: Oversized) -> None:
        if packet.number:
            self._acknowledge(packet.number)
        self.session.drop(Reason.PAYLOAD, packet.sample, why=f"the packet is longer than {MAX_PACKET} octets")

    def _acknowledge(self, number: int) -> None:
        paho = self._paho
        if paho is not None:
            paho.ack(number, 1)
            self._owed += paho.want_write()
