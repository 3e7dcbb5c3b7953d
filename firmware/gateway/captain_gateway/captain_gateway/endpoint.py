"""Client of a station's endpoint: a thread that receives, and a socket that sends."""

import json
import threading
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol, TypeAlias

import zmq

from .errors import RefusedError
from .pairing import Arrival, How, Joining, Key, indication
from .told import table

Socket: TypeAlias = "zmq.Socket[bytes]"

# A station sends a heartbeat once a second. After three lost ones it counts as absent.
SILENT_S = 3.0
# Timeouts of poll(). They bound the delay until the thread notices end(). While messages wait for their indication,
# the shorter one applies.
IDLE_MS, BUSY_MS = 200, 10
# Limit for a received message. The status of a station with a hundred interfaces has 100 KB.
MOST_OCTETS = 1 << 20
# Receive queue of libzmq, in messages: 10 s at 1,000 messages a second if the thread is late.
HIGH_WATER = 10_000
# Send queue in messages, for a station that does not read: 1 s at 1,000 a second. Older messages are useless.
MOST_UNSENT = 1_000
BATCH = 64
# A machine that loses power or network does not close its connections. ZMTP heartbeats detect that at both ends.
HEARTBEAT_MS, HEARTBEAT_TIMEOUT_MS = 1_000, 3_000


class Address(NamedTuple):
    """Host and ports of a station's endpoint; `pull` and `report` are 0 if the station lacks these ports."""

    host: str
    to_users: int
    pull: int
    from_users: int
    report: int

    def url(self, port: int) -> str:
        return f"tcp://[{self.host}]:{port}" if ":" in self.host else f"tcp://{self.host}:{port}"


class Listener(Protocol):
    """Receiver of a station's messages. All methods are called in the receiving thread."""

    def arrived(self, arrival: Arrival) -> None: ...
    def indicated(self, key: Key, how: How) -> None: ...
    def reported(self, topic: str, told: dict[str, object]) -> None: ...
    def present(self, is_there: bool) -> None: ...
    def passed(self) -> bool:
        """Called after each turn of the loop. Returns whether messages still wait for their indication."""


class Receiving(threading.Thread):
    """Thread with the sockets to ports 5556 and 5558. It passes received messages to the listener."""

    def __init__(
        self, context: "zmq.Context[zmq.Socket[bytes]]", address: Address, joining: Joining, listener: Listener
    ) -> None:
        super().__init__(name="receiving", daemon=True)
        self._context = context
        self._address = address
        self._joining = joining
        self._listener = listener
        self._is_ending = threading.Event()
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self._run()
        except BaseException as error:  # noqa: BLE001 told by the main thread, which ends with it
            self.error = error

    def end(self) -> None:
        self._is_ending.set()
        if self.is_alive():
            self.join()

    def _run(self) -> None:
        users = self._subscriber(self._address.to_users, b"")
        sockets = {users: self._user_message}
        if self._address.report:
            # A subscription to "soon." makes the station send indications at once: messages wait here for theirs.
            topics = (b"soon.", b"indication.", b"confirm.", b"status.", b"time.")
            sockets[self._subscriber(self._address.report, *topics)] = self._report
        try:
            self._listen(users, sockets)
        finally:
            for one in sockets:
                one.close(0)

    def _listen(self, users: Socket, sockets: Mapping[Socket, Callable[[list[bytes]], None]]) -> None:
        poller = zmq.Poller()
        for one in sockets:
            poller.register(one, zmq.POLLIN)
        heard, is_there, is_busy = time.monotonic(), None, False
        while not self._is_ending.is_set():
            ready = dict(poller.poll(BUSY_MS if is_busy else IDLE_MS))
            now = time.monotonic()
            for one, take in sockets.items():
                if one in ready:
                    self._take(one, take)
            if users in ready:
                heard = now
            # is_there is None until a first heartbeat was received or missed.
            is_silent = now - heard >= SILENT_S
            if is_there is is_silent or (is_there is None and (users in ready or is_silent)):
                is_there = not is_silent
                self._listener.present(is_there)
            is_busy = self._listener.passed()

    def _subscriber(self, port: int, *topics: bytes) -> Socket:
        socket = self._context.socket(zmq.SUB)
        socket.set(zmq.RCVHWM, HIGH_WATER)
        socket.set(zmq.MAXMSGSIZE, MOST_OCTETS)
        _watch(socket)
        for topic in topics:
            socket.set(zmq.SUBSCRIBE, topic)
        socket.connect(self._address.url(port))
        return socket

    @staticmethod
    def _take(socket: Socket, take: Callable[[list[bytes]], None]) -> None:
        for _ in range(BATCH):
            try:
                take(socket.recv_multipart(zmq.NOBLOCK))
            except zmq.Again:
                return

    def _user_message(self, frames: list[bytes]) -> None:
        arrival = self._joining.feed(frames)
        if arrival is not None:
            self._listener.arrived(arrival)

    def _report(self, frames: list[bytes]) -> None:
        if len(frames) != 2:
            self._joining.reject(b"".join(frames))
            return
        topic, octets = frames
        if topic.startswith(b"indication."):
            found = indication(octets)
            if found is not None:
                self._listener.indicated(*found)
                return
        elif (told := table(octets)) is not None:
            self._listener.reported(topic.decode("ascii", "backslashreplace"), told)
            return
        self._joining.reject(octets)


class Sending:
    """Socket to the station: PUSH, or PUB if the station has no PULL port. Used by one thread.

    is_silent  True if the station's heartbeat is missing; set by any thread.
    """

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]", address: Address) -> None:
        self.is_silent = False
        self._has_pull = bool(address.pull)
        self._socket = context.socket(zmq.PUSH if self._has_pull else zmq.PUB)
        self._socket.set(zmq.SNDHWM, MOST_UNSENT)
        self._socket.set(zmq.LINGER, 200)
        self._socket.set(zmq.IMMEDIATE, 1)  # refuse messages without a connection, do not queue them for a later one
        _watch(self._socket)
        self._where = address.url(address.pull or address.from_users)
        self._socket.connect(self._where)

    def send(self, pdu: bytes, options: dict[str, object]) -> None:
        """Send a message. Raises RefusedError if no station takes it; with PUB, only a missing heartbeat shows that.

        options  options of the request; empty for none. PUB cannot carry them.
        """
        if self.is_silent:
            raise RefusedError("no-station", f"the station at {self._where} is silent: no heartbeat for 3 s")
        frames = [b"v2x.", pdu]
        if options and self._has_pull:
            frames.append(json.dumps(options).encode())
        try:
            self._socket.send_multipart(frames, zmq.NOBLOCK)
        except zmq.Again as error:
            raise RefusedError("no-station", f"no station takes messages at {self._where}") from error

    def close(self) -> None:
        self._socket.close()


def _watch(socket: Socket) -> None:
    """Enable IPv6 and heartbeats, so that a dead or half-open connection is detected and re-established."""
    socket.set(zmq.IPV6, 1)
    socket.set(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    socket.set(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    socket.set(zmq.HEARTBEAT_TTL, HEARTBEAT_TIMEOUT_MS)
    socket.set(zmq.RECONNECT_IVL_MAX, 1000)
