"""An independent client of a broker: plain paho-mqtt, nothing of the station's own code."""

import queue
import socket
import threading
import time
from collections.abc import Iterable
from typing import Any, NamedTuple, Self

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from firmware.lab.certificates import Pair
from tests.broker.certificates import Authority

PATIENCE = 5.0  # s; reached only by a test that fails
VERSIONS = {5: mqtt.MQTTv5, 3: mqtt.MQTTv311}


class Message(NamedTuple):
    """What the broker delivered."""

    topic: str
    payload: bytes
    qos: int
    is_retained: bool
    expiry_s: int | None = None
    user_properties: tuple[tuple[str, str], ...] = ()


class Client:
    """A connected client, with a thread that reads. `messages` holds what was delivered, in order.

    identity  its certificate and key for TLS, which the authority's certificate then checks; None: without TLS.
    will      topic and payload of its last will.
    """

    def __init__(
        self,
        port: int,
        name: str = "observer",
        *,
        host: str = "localhost",
        authority: Authority | None = None,
        identity: Pair | None = None,
        version: int = 5,
        user: tuple[str, str] | None = None,
        will: tuple[str, bytes] | None = None,
        keep_alive_s: int = 20,
    ) -> None:
        self.messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._version = version
        self._connected, self._acknowledged = threading.Event(), threading.Event()
        self._refused: list[str] = []
        clean: dict[str, Any] = {} if version == 5 else {"clean_session": True}
        self.paho = paho = mqtt.Client(
            CallbackAPIVersion.VERSION2,
            client_id=name,
            protocol=VERSIONS[version],
            reconnect_on_failure=False,
            **clean,
        )
        if authority is not None:
            shown = (str(identity.certificate), str(identity.key)) if identity else (None, None)
            paho.tls_set(str(authority.certificate), *shown)
        if user is not None:
            paho.username_pw_set(*user)
        if will is not None:
            paho.will_set(will[0], will[1], qos=1)
        paho.on_connect = self._on_connect
        paho.on_message = self._on_message
        paho.on_subscribe = lambda *_: self._acknowledged.set()
        paho.on_unsubscribe = lambda *_: self._acknowledged.set()
        paho.on_disconnect = self._on_disconnect
        paho.connect(host, port, keep_alive_s)
        paho.loop_start()
        is_told = self._connected.wait(PATIENCE)
        if not is_told or self._refused:
            self.close()
            raise AssertionError(f"{name} is not connected to {host}:{port}: {self._refused or 'no CONNACK'}")

    def subscribe(self, *filters: str, qos: int = 1, no_local: bool = False) -> Self:
        """Returns when the broker has it."""
        self._acknowledged.clear()
        if self._version == 5:
            self.paho.subscribe([(one, SubscribeOptions(qos=qos, noLocal=no_local)) for one in filters])
        else:
            self.paho.subscribe([(one, qos) for one in filters])
        assert self._acknowledged.wait(PATIENCE), f"no SUBACK for {filters}"
        return self

    def unsubscribe(self, *filters: str) -> None:
        self._acknowledged.clear()
        self.paho.unsubscribe(list(filters))
        assert self._acknowledged.wait(PATIENCE), f"no UNSUBACK for {filters}"

    def publish(
        self,
        topic: str,
        payload: bytes | str,
        *,
        qos: int = 1,
        retain: bool = False,
        expiry_s: int | None = None,
        user_properties: Iterable[tuple[str, str]] = (),
    ) -> None:
        """Returns when it has left (QoS 0), or the broker has it. An empty payload clears what is retained."""
        properties = Properties(PacketTypes.PUBLISH) if self._version == 5 else None
        if properties is not None and expiry_s is not None:
            properties.MessageExpiryInterval = expiry_s
        if properties is not None and (pairs := list(user_properties)):
            properties.UserProperty = pairs
        published = self.paho.publish(topic, payload, qos, retain, properties)
        published.wait_for_publish(PATIENCE)
        assert published.is_published(), f"{topic} was not published"

    def next(self, topic: str = "") -> Message:
        """The next message; with a topic, the next of that very topic: others before it are thrown away."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                message = self.messages.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f"nothing came on {topic or 'any topic'}") from None
            if topic in ("", message.topic):
                return message

    def until(self, payload: bytes | str) -> list[Message]:
        """All messages before the one with this payload, which is taken, too."""
        wanted = payload.encode() if isinstance(payload, str) else payload
        before: list[Message] = []
        while (message := self.next()).payload != wanted:
            before.append(message)
        return before

    def cut(self) -> None:
        """Gone without a good bye: the broker publishes the last will."""
        line = self.paho.socket()
        assert line is not None, "it is not connected"
        line.shutdown(socket.SHUT_RDWR)
        self._leave()

    def close(self) -> None:
        self.paho.disconnect()
        self._leave()

    def _leave(self) -> None:
        """Without its callbacks nothing keeps it, and it closes the sockets that wake its thread."""
        self.paho.loop_stop()
        for name in ("on_connect", "on_disconnect", "on_message", "on_subscribe", "on_unsubscribe"):
            setattr(self.paho, name, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _on_connect(self, _client: Any, _userdata: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._refused.append(str(reason))
        self._connected.set()

    def _on_disconnect(self, _client: Any, _userdata: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if not self._connected.is_set():
            self._refused.append(str(reason))
            self._connected.set()

    def _on_message(self, _client: Any, _userdata: Any, message: Any) -> None:
        properties = message.properties
        self.messages.put(
            Message(
                message.topic,
                bytes(message.payload),
                message.qos,
                bool(message.retain),
                getattr(properties, "MessageExpiryInterval", None),
                tuple(getattr(properties, "UserProperty", ())),
            )
        )
