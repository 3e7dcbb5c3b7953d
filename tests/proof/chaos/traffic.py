"""Messages through a station for as long as it has trouble: each is numbered, and what became of it is known."""

import json
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import zmq

from drivers.wire import frame
from drivers.wire.geonet.protocol import GeoNetworking, Mib, Received
from tests.drivers.host import EGO, request
from tests.proof.chaos.process import Ports

CAM = bytes.fromhex("020200000539")  # of one station: each has a place in the table of neighbours
TOPIC = b"v2x.cam."
RATE_HZ = 10.0  # of each way: a vehicle's most
JOIN_S = 5.0
RECEIVE_BUFFER = 4 << 20

# Who sends: in the upper octet of the number that the messages have behind their header.
USER, BESIDE, RADIO = 1, 2, 3
MAC = bytes.fromhex("020000000042")


class Traffic:
    """A user of the station, and who is at the other ends of its two radios.

    sent, heard  moments by number: of user, of beside, of radio. A message of the user is heard at both ends.
    confirms     how often by interface, outcome and reason.
    """

    def __init__(self, ports: Ports) -> None:
        self.sent: dict[int, float] = {}
        self.heard: dict[str, dict[int, float]] = {"beside": {}, "g5": {}, "user": {}}
        self.confirms: Counter[tuple[str, str, str]] = Counter()
        self.strange = 0  # received, and never sent, or twice
        self._ports = ports
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._push = self._socket(zmq.PUSH, ports.pull)
        self._users = self._socket(zmq.SUB, ports.to_users)
        self._users.subscribe(TOPIC)
        self._report = self._socket(zmq.SUB, ports.report)
        self._report.subscribe(b"confirm.")
        self._beside = _udp(ports.beside_peer)
        self._radio = _udp(ports.radio_peer)
        self._core = GeoNetworking(MAC, Mib(beacon_s=0.0))
        self._poller = zmq.Poller()
        for one in (self._users, self._report, self._beside, self._radio):
            self._poller.register(one, zmq.POLLIN)
        self._count = 0

    def join(self) -> None:
        """Until a message each way has passed; what was sent for this does not count."""
        end = time.monotonic() + JOIN_S
        while not (self.heard["user"] and self.heard["beside"] and self.confirms):
            if time.monotonic() > end:
                raise RuntimeError("no messages pass")
            self.send()
            self.listen(0.05)
        self.listen(1.0)
        self.sent.clear()
        self.confirms.clear()
        for heard in self.heard.values():
            heard.clear()

    def send(self) -> None:
        """One of each way."""
        self._count += 1
        for who, leave in ((USER, self._from_user), (BESIDE, self._from_beside), (RADIO, self._from_radio)):
            number = who << 24 | self._count
            self.sent[number] = time.monotonic()
            leave(CAM + number.to_bytes(4, "big"))

    def listen(self, seconds: float) -> None:
        """Take what comes for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._poller.poll(left * 1000)
            self._take()

    def close(self) -> None:
        for one in (self._push, self._users, self._report, self._beside, self._radio):
            one.close()
        self._context.destroy(linger=0)

    def of(self, who: int) -> dict[int, float]:
        """What somebody has sent."""
        return {number: at for number, at in self.sent.items() if number >> 24 == who}

    def _take(self) -> None:
        for pdu in _all(lambda: self._users.recv_multipart(zmq.NOBLOCK)[1]):
            self._note("user", pdu)
        for octets in _all(lambda: self._report.recv_multipart(zmq.NOBLOCK)[1]):
            self._confirm(json.loads(octets))
        for pdu in _all(lambda: self._beside.recv(2048)):
            self._note("beside", pdu)
        for octets in _all(lambda: self._radio.recv(2048)):
            ethernet = frame.unwrap(octets)
            assert isinstance(ethernet, frame.Ethernet)
            event = self._core.receive(ethernet.packet, ethernet.source, time.monotonic(), EGO.its_ms, lambda: EGO)
            if isinstance(event, Received):
                self._note("g5", event.pdu)

    def _note(self, where: str, pdu: bytes) -> None:
        number = int.from_bytes(pdu[len(CAM) :], "big")
        heard = self.heard[where]
        if number in heard or number not in self.sent:
            self.strange += 1
        else:
            heard[number] = time.monotonic()

    def _confirm(self, told: dict[str, Any]) -> None:
        if told["outcome"] == "accepted":
            for interface in told["interfaces"]:
                self.confirms[interface, "accepted", ""] += 1
        else:
            self.confirms[told["interface"], told["outcome"], told["reason"] or ""] += 1

    def _from_user(self, pdu: bytes) -> None:
        self._push.send_multipart([TOPIC, pdu])

    def _from_beside(self, pdu: bytes) -> None:
        self._beside.sendto(pdu, ("127.0.0.1", self._ports.beside))

    def _from_radio(self, pdu: bytes) -> None:
        octets = frame.wrap(MAC, self._core.encode(request(pdu), 0.0, EGO))
        with suppress(ConnectionRefusedError):  # nobody has the radio's library loaded
            self._radio.sendto(octets, ("127.0.0.1", self._ports.radio))

    def _socket(self, kind: int, port: int) -> "zmq.Socket[bytes]":
        made = self._context.socket(kind)
        made.linger = 0
        made.rcvhwm = made.sndhwm = 0
        made.connect(f"tcp://127.0.0.1:{port}")
        return made


def _all(receive: Callable[[], bytes]) -> Iterator[bytes]:
    while True:
        try:
            yield receive()
        except (BlockingIOError, zmq.Again):
            return
        except ConnectionRefusedError:  # what was sent before met nobody
            continue


def _udp(port: int) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    made.bind(("127.0.0.1", port))
    return made
