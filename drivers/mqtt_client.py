"""The process with the MQTT client: one loop over the station's channel and the broker's socket.

Started by `mqtt.py` as a worker. It reads settings, then requests, and tells what is received and how the broker is;
wire/v2n_talk.py has the messages. It ends when the station closes its socket: with a good-bye to the broker if it was
told to leave, else without one, so that the broker publishes the last will of a station that was killed.
"""

import math
import os
import select
import socket
import time

from board.child import MAX_MESSAGE
from board.errors import StationError
from board.worker import jitter
from drivers import mqtt_credentials, mqtt_profile
from drivers.mqtt_broker import broker
from drivers.mqtt_network import Network
from drivers.mqtt_outbox import Outbox
from drivers.mqtt_session import Session
from drivers.mqtt_settings import MqttSettings, settings_in
from drivers.reason import Reason
from drivers.wire import v2n_talk as talk
from drivers.wire.v2n import Identity, Profile

AT_ONCE = 32  # messages of the station, before the broker has its turn

# What comes from a broker waits rather than what comes by radio: with two cores, bursts of 5,000/s make the 99th
# percentile of the other interfaces 2.3 to 2.7 times as long where both have the same rank, and 1.5 times so.
NICENESS = 10

# Messages in the socket are those that nothing overtakes. The kernel doubles it and counts some 800 octets for a CAM.
SEND_BUFFER = 32768


def serve(channel: socket.socket) -> None:
    """Run the client until the station closes its end of the channel."""
    os.nice(NICENESS)
    first = channel.recv(MAX_MESSAGE)
    if not first:
        return
    channel.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    try:
        process = Process(channel, settings_in(first))
    except StationError as error:
        channel.send(talk.fault(error.message, error.hint))
        channel.recv(MAX_MESSAGE)  # until it is heard: the end of a process would be told first
        return
    process.run()


class Process:
    """Session, network and the way to the station. Raises StationError where the settings cannot work."""

    def __init__(self, channel: socket.socket, wanted: MqttSettings) -> None:
        profile = profile_of(wanted)
        check(wanted)
        self._channel = channel
        self._network = Network(wanted, profile.lost(), starts_anew=profile.moves)
        self._outbox = Outbox(channel, frozenset(wanted.urgent), self._dropped)
        self._session = Session(wanted, profile, self._network, self._outbox.say, jitter, time.time_ns)
        self._is_told_to_leave = False
        self._network.session = self._session

    def run(self) -> None:
        session, network, outbox = self._session, self._network, self._outbox
        session.start(time.monotonic())
        while True:
            ready = self._wait()
            is_over = self._channel.fileno() in ready and not self._read()
            now = time.monotonic()
            network.turn(now, bool(ready - {self._channel.fileno()}))
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
        """Until something can be done; the descriptors that can be read from."""
        network = self._network
        reads, writes = network.wants()
        if self._outbox.is_waiting:
            writes.append(self._channel.fileno())
        due = min(self._session.deadline(), network.deadline())
        left = 0.0 if network.has_more else max(0.0, due - time.monotonic())
        ready, _, _ = select.select([self._channel.fileno(), *reads], writes, [], None if left == math.inf else left)
        return set(ready)

    def _read(self) -> bool:
        """Take what the station says; False when it has closed its end."""
        for _ in range(AT_ONCE):
            try:
                message = self._channel.recv(MAX_MESSAGE, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return True
            except ConnectionResetError:
                continue  # it has closed with messages of ours unread; told once, then come its last ones
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
    """The profile that the settings name. Raises StationError."""
    identity = Identity(wanted.host, wanted.station, wanted.uuid, wanted.prefix)
    loaded = mqtt_profile.load(wanted.profile)
    # Those that ship have types that this station may have given other names.
    if wanted.types and wanted.profile not in mqtt_profile.names():
        loaded.check_types(wanted.types)
    description = loaded.adapted(wanted.qos, wanted.status_topic, wanted.depths)
    return Profile(description, identity, mqtt_profile.codec(description, wanted.editions))


def check(wanted: MqttSettings) -> None:
    """Whether files can be used that the settings name. Raises InterfaceError: no try will help."""
    if wanted.password_file:
        mqtt_credentials.password(wanted)
    if broker(wanted.url).has_tls:
        mqtt_credentials.context(wanted)
