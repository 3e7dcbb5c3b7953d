"""paho-mqtt on a socket that is connected already: CONNECT, properties, and what its answers say."""

import select
import time
from functools import lru_cache
from typing import Any

from paho.mqtt.client import Client as PahoClient
from paho.mqtt.client import ConnectFlags
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from board.errors import ProtocolError
from drivers import mqtt_credentials
from drivers.mqtt_broker import broker
from drivers.mqtt_line import Line
from drivers.mqtt_options import MqttOptions
from drivers.mqtt_window import Accepted
from drivers.wire.mqtt_packets import CONNACK
from drivers.wire.v2n import Publication

UNACCEPTABLE_VERSION = 1  # return code of CONNACK (MQTT 3.1.1, clause 3.2.2.3)

MAX_WORDS = 200  # characters of a broker's own explanation

LINGER_S = 0.3  # for the last words to be read: the station kills this process a little later


class Paho(PahoClient):
    """paho's client for one connection.

    is_clean  it starts without what an earlier one left, whatever the settings say.
    """

    def __init__(self, line: Line, settings: MqttOptions, is_clean: bool = False) -> None:
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
        self.max_inflight_messages_set(0)  # the session counts

    def greet(self, will: Publication | None) -> None:
        """CONNECT. Raises InterfaceError for a password that cannot be read."""
        settings = self._settings
        if settings.username:
            # A password is octets; paho takes them as well.
            self.username_pw_set(settings.username, mqtt_credentials.password(settings))  # type: ignore[arg-type]
        if will is not None:
            self.will_set(will.topic, will.payload, will.qos, will.retain)
        host, port, _ = broker(settings.url)
        if self.is_5:
            properties = _properties(PacketTypes.CONNECT)
            # No MaximumPacketSize: the broker would drop what is longer (MQTT 5.0, 3.1.2.11.4), and nobody count it.
            if not settings.clean:
                properties.SessionExpiryInterval = settings.session_expiry_s
            self.connect(host, port, settings.keep_alive_s, clean_start=self._is_clean, properties=properties)
        else:
            self.connect(host, port, settings.keep_alive_s)

    def send(self, publication: Publication) -> int:
        """publish(); returns the number by which it is acknowledged."""
        topic, payload, qos, retain, expiry_s = publication
        properties = _of_publish(expiry_s) if self.is_5 else None
        return self.publish(topic, payload, qos, retain, properties).mid

    def finish(self) -> None:
        """After disconnect(): wait until it is written and the broker has closed, or for LINGER_S."""
        end, line = time.monotonic() + LINGER_S, self.line
        try:
            while not line.is_closed and (left := end - time.monotonic()) > 0:
                if select.select([], [line.fileno()], [], left)[1]:
                    self.loop_write()
            line.shut()
            while (left := end - time.monotonic()) > 0:
                if select.select([line.fileno()], [], [], left)[0]:
                    line.skip()  # a socket that is closed with octets unread takes back what it has sent last
        except (OSError, EOFError, ProtocolError):
            pass
        line.end()

    def _create_socket(self) -> Any:
        return self.line


class Packed(Properties):
    """Properties as octets: to make paho's own takes as long as to send a message."""

    octets: bytes

    def __init__(self, octets: bytes) -> None:
        object.__setattr__(self, "octets", octets)

    def pack(self) -> bytes:
        return self.octets


@lru_cache(maxsize=256)  # expiries are few
def _of_publish(expiry_s: int | None) -> Packed:
    properties = _properties(PacketTypes.PUBLISH)
    if expiry_s is not None:
        properties.MessageExpiryInterval = expiry_s
    return Packed(properties.pack())  # type: ignore[no-untyped-call]


def _properties(kind: int) -> Properties:
    return Properties(kind)  # type: ignore[no-untyped-call]


def check_version(packet: bytes) -> None:
    """paho would try an older version by itself. Raises ProtocolError."""
    if len(packet) == 4 and packet[0] >> 4 == CONNACK and packet[3] == UNACCEPTABLE_VERSION:
        hint = 'set version = "3.1.1" in place of 5, or the other way round'
        raise ProtocolError("refuses the connection: Unsupported protocol version", hint)


def accepted_of(flags: ConnectFlags, properties: Properties | None) -> Accepted:
    """What a CONNACK says."""
    return Accepted(
        receive_maximum=getattr(properties, "ReceiveMaximum", 65535),
        maximum_packet=getattr(properties, "MaximumPacketSize", 268_435_460),
        maximum_qos=getattr(properties, "MaximumQoS", 2),
        retains=bool(getattr(properties, "RetainAvailable", 1)),
        is_resumed=flags.session_present,
    )


def words_of(properties: Properties | None) -> str:
    """A broker's own explanation, as far as it can be shown."""
    words = str(getattr(properties, "ReasonString", ""))[:MAX_WORDS]
    return words if words.isprintable() else ""
