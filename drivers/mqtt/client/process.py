"""MQTT process: one loop over the station's channel and the broker's socket.

The driver starts it as a worker (uplink.py). It reads settings, then requests, and reports received messages and the
link; wire/v2n/talk.py defines the messages. It ends when the station closes its socket. After a LEAVE message it sends
DISCONNECT to the broker. Without LEAVE it does not, so the broker publishes the last will of a killed station.
"""

import math
import os
import select
import socket
import time

from board.runtime.child import MAX_MESSAGE
from board.runtime.errors import StationError
from board.runtime.worker import jitter
from drivers.mqtt import profile as mqtt_profile
from drivers.mqtt.broker import broker
from drivers.mqtt.client import credentials
from drivers.mqtt.client.network import Network
from drivers.mqtt.client.outbox import Outbox
from drivers.mqtt.client.session import Session
from drivers.mqtt.client.settings import MqttSettings, settings_in
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.profile import Identity, Profile

AT_ONCE = 32  # most messages of the station that are read before the broker's socket

# The process runs at a lower priority than the station, so that messages of a broker delay those of the radio less.
# Measured on two cores with bursts of 5,000/s: the 99th percentile of the other interfaces' delay grows to 1.5 times.
# At equal priority it grows to 2.3 to 2.7 times.
NICENESS = 10

# Small, because no message can overtake those that are already in the socket. The kernel doubles this size and counts
# about 800 octets for a CAM.
SEND_BUFFER = 32768


def serve(channel: socket.socket) -> None:
    """Run the client until the station closes its end of the channel, a socket."""
    os.nice(NICENESS)
    first = channel.recv(MAX_MESSAGE)
    if not first:
        return
    channel.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    try:
        process = Process(channel, settings_in(first))
    except StationError as error:
        channel.send(talk.fault(error.message, error.hint))
        channel.recv(MAX_MESSAGE)  # wait until the station has read the fault: else it would report the process's end
        return
    process.run()


class Process:
    """Session, network, and outbox to the station. Raises StationError if the settings cannot work."""

    def __init__(self, channel: socket.socket, wanted: MqttSettings) -> None:
        profile = profile_of(wanted)
        check(wanted)
        self._channel = channel
        self._network = Network(wanted, profile.lost(), starts_anew=profile.moves)
        self._outbox = Outbox(channel, frozenset(wanted.urgent), self._dropped)
        self._session = Session(wanted, profile, self._network, self._outbox.say, jitter, time.time_ns)
        self._is_told_to_leave = False

    def run(self) -> None:
        session, network, outbox = self._session, self._network, self._outbox
        session.start(time.monotonic())
        while True:
            ready = self._wait()
            is_over = self._channel.fileno() in ready and not self._read()
            now = time.monotonic()
            network.turn(session, now, bool(ready - {self._channel.fileno()}))
            if now >= session.deadline():
                session.expire(now)
            if outbox.is_waiting:
                outbox.flush()
            if is_over:
                break
        if self._is_told_to_leave:
            session.close(now)
            network.finish()
        else:
            network.drop()

    def _wait(self) -> set[int]:
        """Wait until there is work; return the readable descriptors."""
        network = self._network
        reads, writes = network.wants()
        if self._outbox.is_waiting:
            writes.append(self._channel.fileno())
        due = min(self._session.deadline(), network.deadline())
        left = 0.0 if network.has_more else max(0.0, due - time.monotonic())
        ready, _, _ = select.select([self._channel.fileno(), *reads], writes, [], None if left == math.inf else left)
        return set(ready)

    def _read(self) -> bool:
        """Handle waiting messages of the station; return False if it has closed its end."""
        for _ in range(AT_ONCE):
            try:
                message = self._channel.recv(MAX_MESSAGE, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return True
            except ConnectionResetError:
                continue  # the station closed without reading all messages; its last messages follow this error
            if not message:
                return False
            if message[0] == talk.LEAVE:
                self._is_told_to_leave = True
                continue
            self._session.take(message, time.monotonic())
        return True

    def _dropped(self, pdu: bytes) -> None:
        self._session.drop(Reason.RECEIVE_QUEUE, pdu)


def profile_of(wanted: MqttSettings) -> Profile:
    """Return the profile that the settings name. Raises StationError if it is unknown or invalid."""
    identity = Identity(wanted.host, wanted.station, wanted.uuid, wanted.prefix)
    loaded = mqtt_profile.load(wanted.profile)
    # The types of shipped profiles are not checked, because this station may have given them other names.
    if wanted.types and wanted.profile not in mqtt_profile.names():
        loaded.check_types(wanted.types)
    description = loaded.adapted(wanted.qos, wanted.status_topic, wanted.depths)
    return Profile(description, identity, mqtt_profile.codec(description, wanted.editions))


def check(wanted: MqttSettings) -> None:
    """Check the files that the settings name. Raises InterfaceError if one cannot be used: retries are then useless."""
    if wanted.password_file:
        credentials.password(wanted)
    if broker(wanted.url).has_tls:
        credentials.context(wanted)
