"""A back end's connection to a broker: shared subscriptions, connected again when it is lost, left without loss.

paho-mqtt in the thread of the tool: what is not read yet waits in TCP, where the broker sees it, in no queue of ours.
"""

import random
import ssl
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from board.errors import InterfaceError, StationError
from drivers import mqtt_credentials, mqtt_trouble
from drivers.mqtt_broker import broker
from drivers.mqtt_options import MqttOptions
from drivers.wire.v2n_message import Delivery

if TYPE_CHECKING:
    from firmware.tap.paho import Client

ANSWER_S = 10.0  # unless it is wanted sooner
FIRST_DELAY_S, LONGEST_DELAY_S = 0.5, 30.0
# After UNSUBACK a broker sends what it had queued for us; when nothing came for so long there is nothing left.
DRAINED_S = 0.3
LEAVE_S = 5.0  # and for that, altogether
SHORT_S = 5.0  # a connection that is lost sooner has a reason
TAKEN_OVER = 142  # reason code of DISCONNECT: another client came with our name (MQTT 5.0, 3.14.2.1)
# mosquitto's: of all clients, since its start. Another broker sends none, or refuses it.
DROPPED = "$SYS/broker/publish/messages/dropped"


class Connection:
    """Deliveries of some filters.

    filters  as the broker is asked, with their quality of service.
    take     is called with each delivery, in turn().
    say      is called with one line when the connection is lost, when another try fails for another reason, and when
             it is back.
    answer_s  limit for each of: TCP and TLS, CONNACK with SUBACK.
    counts   losses, gap_s (seconds without a connection), repeated (DUP), dropped (by the broker, as far as it says).
    """

    def __init__(
        self,
        settings: MqttOptions,
        filters: Sequence[tuple[str, int]],
        take: Callable[[Delivery], None],
        say: Callable[[str], None],
        answer_s: float = ANSWER_S,
    ) -> None:
        self._answer_s = answer_s
        self.broker = broker(settings.url)
        self.counts = {"losses": 0.0, "gap_s": 0.0, "repeated": 0.0, "dropped": 0.0}
        self.is_up = False
        self._settings = settings
        self._filters = list(filters)
        self._take = take
        self._say = say
        self._client: Client | None = None
        self._refusal = self._last_error = ""
        self._answer_by = self._retry_at = self._lost_at = self._up_at = self._heard_at = 0.0
        self._delay_s = FIRST_DELAY_S
        self._dropped_before: float | None = None
        self._has_left = False

    @property
    def has_been_up(self) -> bool:
        return self._up_at > 0.0

    def open(self) -> None:
        """Connect and subscribe. Raises InterfaceError that names the broker and says why not."""
        try:
            self._connect()
            while not self.is_up:
                self._loop(0.1)
        finally:
            if not self.is_up:
                self._forget()

    def turn(self, longest_s: float) -> None:
        """Take what is there, waiting for it at most so long. Raises StationError where going on is useless."""
        if self._client is None:
            self._try_again(longest_s)
            return
        try:
            self._loop(longest_s)
        except InterfaceError as error:
            self._lost(error)

    def leave(self) -> None:
        """Unsubscribe, take what the broker had for us, and say good bye. What it has sent is not lost."""
        client = self._client
        if client is None:
            return
        try:
            self._has_left = False
            client.unsubscribe([text for text, _ in self._filters])
            deadline = time.monotonic() + LEAVE_S
            self._heard_at = time.monotonic()
            while time.monotonic() < deadline:
                self._loop(0.05)
                if self._has_left and time.monotonic() - self._heard_at > DRAINED_S:
                    break
            client.disconnect()
            client.loop_write()
        except InterfaceError as error:
            self._say(f"captain: {error.message} while leaving")
        finally:
            self._forget()

    # -- one connection

    def _connect(self) -> None:
        self._refusal = ""
        client = self._client = self._made()
        try:
            client.connect(self.broker.host, self.broker.port, self._settings.keep_alive_s, **self._start())
        except (OSError, ValueError) as error:
            raise InterfaceError(f"{self.broker}: {mqtt_trouble.why(error, _is_of_tls(error))}") from error
        self._answer_by = time.monotonic() + self._answer_s

    def _made(self) -> "Client":
        from paho.mqtt.client import MQTTv5, MQTTv311
        from paho.mqtt.enums import CallbackAPIVersion

        from firmware.tap.paho import Client

        settings = self._settings
        is_five = settings.version == 5
        more: dict[str, Any] = {} if is_five else {"clean_session": settings.clean}
        protocol = MQTTv5 if is_five else MQTTv311
        client = Client(CallbackAPIVersion.VERSION2, settings.client_id, protocol=protocol, **more)
        client.connect_timeout = self._answer_s
        if self.broker.has_tls:
            client.tls_set_context(mqtt_credentials.context(settings))
        if settings.username:
            client.username_pw_set(settings.username)
            client.password = mqtt_credentials.password(settings)  # type: ignore[assignment] # octets are none of its types
        client.on_connect = self._on_connect
        client.on_subscribe = self._on_subscribe
        client.on_unsubscribe = self._on_unsubscribe
        client.on_disconnect = self._on_disconnect
        client.on_message = self._on_message
        return client

    def _start(self) -> dict[str, Any]:
        if self._settings.version != 5:
            return {}
        from paho.mqtt.packettypes import PacketTypes
        from paho.mqtt.properties import Properties

        properties: Any = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
        if not self._settings.clean:
            properties.SessionExpiryInterval = self._settings.session_expiry_s
        return {"clean_start": self._settings.clean, "properties": properties}

    def _loop(self, longest_s: float) -> None:
        """One turn of paho. Raises InterfaceError when the connection is gone or the broker refuses."""
        assert self._client is not None
        code = self._client.loop(longest_s)
        if self._refusal:
            raise InterfaceError(f"{self.broker}: {self._refusal}")
        if code:
            why = mqtt_trouble.why(self._client.failure or EOFError())
            raise InterfaceError(f"{self.broker}: {why if self.is_up else mqtt_trouble.early(why, self._settings)}")
        if not self.is_up and time.monotonic() > self._answer_by:
            raise InterfaceError(f"{self.broker}: no answer to CONNECT or SUBSCRIBE in {self._answer_s:g} s")

    def _forget(self) -> None:
        client, self._client, self.is_up = self._client, None, False
        if client is not None and (line := client.socket()) is not None:
            client.on_disconnect = None
            line.close()

    # -- lost and found

    def _lost(self, error: InterfaceError) -> None:
        if self.is_up:
            self.counts["losses"] += 1
            self._lost_at = time.monotonic()
            lasted_s = self._lost_at - self._up_at
            # Not every broker says that it has another client of that name (mosquitto 2.0.11 does not).
            doubt = f"; is there another client named {self._settings.client_id}?" if lasted_s < SHORT_S else ""
            self._say(f"captain: {error.message} after {lasted_s:.1f} s{doubt}; connecting again")
        elif error.message != self._last_error:
            self._say(f"captain: {error.message}; trying again and again")
        self._last_error = error.message
        self._forget()
        self._retry_at = time.monotonic() + self._delay_s * random.uniform(0.5, 1.0)
        self._delay_s = min(2 * self._delay_s, LONGEST_DELAY_S)

    def _try_again(self, longest_s: float) -> None:
        wait = self._retry_at - time.monotonic()
        if wait > 0:
            time.sleep(min(wait, longest_s))
            return
        try:
            self._connect()
        except InterfaceError as error:
            self._lost(error)

    def _is_back(self) -> None:
        self.is_up = True
        self._up_at = time.monotonic()
        self._delay_s = FIRST_DELAY_S
        if self._lost_at:
            gap_s, self._lost_at = time.monotonic() - self._lost_at, 0.0
            self.counts["gap_s"] += gap_s
            self._say(f"captain: {self.broker}: connected again after {gap_s:.1f} s")

    # -- what paho calls

    def _on_connect(self, client: Any, userdata: Any, flags: Any, code: Any, properties: Any) -> None:
        if code.is_failure:
            self._refusal = f"refuses the connection: {mqtt_trouble.refusal(str(code))}"
            return
        client.subscribe(self._options_of(self._filters))
        client.subscribe(self._options_of([(DROPPED, 0)]))

    def _options_of(self, filters: Sequence[tuple[str, int]]) -> Any:
        if self._settings.version != 5:
            return list(filters)
        from paho.mqtt.subscribeoptions import SubscribeOptions

        return [(text, SubscribeOptions(qos=qos)) for text, qos in filters]

    def _on_subscribe(self, client: Any, userdata: Any, mid: int, codes: Sequence[Any], _: Any) -> None:
        if self.is_up:
            return  # to DROPPED, which a broker need not have
        refused = [
            f"{text}: {mqtt_trouble.refusal(str(code))}"
            for (text, _), code in zip(self._filters, codes, strict=False)
            if code.is_failure
        ]
        if refused:
            self._refusal = f"refuses the subscription to {', '.join(refused)}"
            return
        self._is_back()

    def _on_disconnect(self, client: Any, userdata: Any, flags: Any, code: Any, properties: Any) -> None:
        if not flags.is_disconnect_packet_from_server:
            return
        if code.value == TAKEN_OVER:
            name = self._settings.client_id
            hint = "each copy needs a --client-id of its own; without the option it has one"
            raise StationError(f"{self.broker}: another client came with the name {name}", hint)
        self._refusal = f"ends the connection: {mqtt_trouble.refusal(str(code))}"

    def _on_unsubscribe(self, *_: Any) -> None:
        self._has_left = True

    def _on_message(self, client: Any, userdata: Any, message: Any) -> None:
        self._heard_at = time.monotonic()
        topic = _topic(message)
        if topic == DROPPED:
            self._note_dropped(message.payload)
            return
        self.counts["repeated"] += message.dup
        self._take(Delivery(topic, message.payload, bool(message.retain)))

    def _note_dropped(self, payload: bytes) -> None:
        if not (payload.isdigit() and len(payload) < 20):
            return
        if self._dropped_before is None:
            self._dropped_before = float(payload)
        # A broker that was started again counts from 0.
        self.counts["dropped"] = max(self.counts["dropped"], float(payload) - self._dropped_before)


def _topic(message: Any) -> str:
    """What is no UTF-8 stays in it as surrogates, for the tap to count."""
    try:
        return str(message.topic)
    except UnicodeDecodeError as error:
        return error.object.decode(errors="surrogateescape")


def _is_of_tls(error: Exception) -> bool:
    """Whether a connection ended in the handshake; before it, it is refused or not answered at all."""
    return isinstance(error, ssl.SSLError | ConnectionResetError)
