"""paho-mqtt on a connected socket: CONNECT, properties, and parsers of the broker's answers."""

import select
import time
from collections.abc import Collection
from functools import lru_cache
from typing import Any

from paho.mqtt.client import Client as PahoClient
from paho.mqtt.client import ConnectFlags
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from board.runtime.errors import ProtocolError
from drivers.mqtt.broker import broker
from drivers.mqtt.client import credentials
from drivers.mqtt.client.line import BrokerLine
from drivers.mqtt.client.window import Accepted
from drivers.mqtt.options import MqttOptions
from drivers.wire.mqtt_packets import CONNACK
from drivers.wire.v2n.profile import Publication

UNACCEPTABLE_VERSION = 1  # return code of a CONNACK that refuses the MQTT version (MQTT 3.1.1, clause 3.2.2.3)

MAX_WORDS = 200  # most characters shown of a broker's own explanation

LINGER_S = 0.3  # longest wait for the broker to read the last messages; the station kills this process a little later


class Paho(PahoClient):
    """paho's client for one connection.

    is_clean  True: the session starts clean, even if the settings say otherwise.
    """

    def __init__(self, line: BrokerLine, settings: MqttOptions, is_clean: bool = False) -> None:
        self.is_5 = settings.version == 5
        self._is_clean = settings.clean or is_clean
        super().__init__(
            CallbackAPIVersion.VERSION2,
            client_id=settings.client_id,
            clean_session=None if self.is_5 else self._is_clean,
            protocol=MQTTProtocolVersion.MQTTv5 if self.is_5 else MQTTProtocolVersion.MQTTv311,
            reconnect_on_failure=False,
            manual_ack=True,
        )
        self.line = line
        self._settings = settings
        self.max_inflight_messages_set(0)  # no limit in paho: Window limits unacknowledged publications

    def send_connect(self, will: Publication | None) -> None:
        """Send CONNECT, with a last will if there is one. Raises InterfaceError if the password cannot be read."""
        settings = self._settings
        if settings.username:
            # A password consists of octets in MQTT; paho accepts octets although its annotation says text.
            self.username_pw_set(settings.username, credentials.password(settings))  # type: ignore[arg-type] # takes octets
        if will is not None:
            self.will_set(will.topic, will.payload, will.qos, will.retain)
        host, port, _ = broker(settings.url)
        if self.is_5:
            properties = _properties(PacketTypes.CONNECT)
            # MaximumPacketSize is not set: the broker would discard longer packets (MQTT 5.0, 3.1.2.11.4), and they
            # would not be counted.
            if not settings.clean:
                properties.SessionExpiryInterval = settings.session_expiry_s
            self.connect(host, port, settings.keep_alive_s, clean_start=self._is_clean, properties=properties)
        else:
            self.connect(host, port, settings.keep_alive_s)

    def send(self, publication: Publication) -> int:
        """Send PUBLISH; return the packet identifier, which the acknowledgement repeats."""
        topic, payload, qos, retain, expiry_s = publication
        properties = _of_publish(expiry_s) if self.is_5 else None
        return self.publish(topic, payload, qos, retain, properties).mid

    def subscribe_to(self, filters: Collection[tuple[str, int]]) -> None:
        """Send SUBSCRIBE; with MQTT 5.0 by noLocal, so that the broker does not return own publications.

        A shared subscription must not have noLocal (MQTT 5.0, clause 3.8.3.1).
        """
        if self.is_5:
            shared = "$share/"
            self.subscribe(
                [(name, SubscribeOptions(qos, noLocal=not name.startswith(shared))) for name, qos in filters]
            )
        else:
            self.subscribe(list(filters))

    def finish(self) -> None:
        """Wait after disconnect() until all is written and the broker has closed, at most LINGER_S; then close."""
        end, line = time.monotonic() + LINGER_S, self.line
        try:
            while not line.is_closed and (left := end - time.monotonic()) > 0:
                if select.select([], [line.fileno()], [], left)[1]:
                    self.loop_write()
            line.shut()
            while (left := end - time.monotonic()) > 0:
                if select.select([line.fileno()], [], [], left)[0]:
                    line.skip()  # closing a socket with unread octets could discard octets that were sent last
        except (OSError, EOFError, ProtocolError):
            pass
        line.end()

    def _create_socket(self) -> Any:
        return self.line


class Packed(Properties):
    """Properties already encoded as octets: paho needs as long to create and encode them as to send a message."""

    octets: bytes

    def __init__(self, octets: bytes) -> None:
        object.__setattr__(self, "octets", octets)

    def pack(self) -> bytes:
        return self.octets


@lru_cache(maxsize=256)  # few different expiry times are used
def _of_publish(expiry_s: int | None) -> Packed:
    properties = _properties(PacketTypes.PUBLISH)
    if expiry_s is not None:
        properties.MessageExpiryInterval = expiry_s
    return Packed(properties.pack())  # type: ignore[no-untyped-call]


def _properties(kind: int) -> Properties:
    return Properties(kind)  # type: ignore[no-untyped-call]


def check_version(packet: bytes) -> None:
    """Check a CONNACK. Raises ProtocolError if it refuses the MQTT version: paho would then try an older one."""
    if len(packet) == 4 and packet[0] >> 4 == CONNACK and packet[3] == UNACCEPTABLE_VERSION:
        hint = 'set option version to the other one of "3.1.1" and "5"'
        raise ProtocolError("refuses the connection: Unsupported protocol version", hint)


def accepted_of(flags: ConnectFlags, properties: Properties | None) -> Accepted:
    """Return the broker's limits in a CONNACK; a limit that it lacks gets the greatest possible value."""
    return Accepted(
        receive_maximum=getattr(properties, "ReceiveMaximum", 65535),
        maximum_packet=getattr(properties, "MaximumPacketSize", 268_435_460),
        maximum_qos=getattr(properties, "MaximumQoS", 2),
        retains=bool(getattr(properties, "RetainAvailable", 1)),
        is_resumed=flags.session_present,
    )


def words_of(properties: Properties | None) -> str:
    """Return a broker's own explanation (ReasonString), cut to MAX_WORDS; empty if it has unprintable characters."""
    words = str(getattr(properties, "ReasonString", ""))[:MAX_WORDS]
    return words if words.isprintable() else ""
