"""Senders and receivers of the V2N benchmark, with latency of each message.

usage: python -m tests.bench.v2n_ends ROLE PORT COUNT RATE QOS

roles  send-user     PUB to a station's port              receive-user    SUB to it
       send-broker   publisher at a broker's plain port   receive-broker  subscriber there
       burst-broker  the same, RATE for 0.4 s of every second
Each says "ready". A sender waits for a line on stdin before it begins. A receiver prints one JSON object at its end:
{"count":, "median_us":, "p99_us":, "max_us":}, without the first WARM_UP. Each has one thread and one socket, and is the
same for all measurements. A PDU carries CLOCK_MONOTONIC of its sending at the place that load.h has.
"""

import base64
import contextlib
import json
import socket
import struct
import sys
import time
from collections.abc import Callable

import zmq

from tests.broker import mute
from tests.broker.client import Client

PDU_OCTETS = 300
AT_TIME = 14
QUIET_S = 2.0  # nothing for so long after the first: it is over
START_S = 20.0
WARM_UP = 300  # messages
BURST_S = 0.4
BUNDLE_S = 0.001  # in a burst, messages leave in bundles: the sender shall not need a core of its own
# MQTT 5, clean start, no keep-alive, client id "sender".
CONNECT = b"\x10\x13\0\x04MQTT\x05\x02\0\0\0\0\x06sender"
HEAD = bytes((2, 2, 0, 0, 0, 42))
TOPIC = "v2x/btp/2001"


def main() -> int:
    role, port, count, rate, qos = sys.argv[1], *map(int, sys.argv[2:6])
    sends = {"send-user": send_user, "send-broker": send_broker}
    receives = {"receive-user": receive_user, "receive-broker": receive_broker}
    if role in sends:
        send = sends[role](port, qos)
        print("ready", flush=True)
        sys.stdin.readline()
        paced(send, count, rate)
        sys.stdin.readline()  # what has left is still on its way
        return 0
    if role == "burst-broker":
        bursts(port, rate)
    late = receives[role](port, count, qos)[WARM_UP:]
    late.sort()
    print(json.dumps({"count": len(late)} | (figures(late) if late else {})), flush=True)
    return 0


def figures(late_ns: list[int]) -> dict[str, float]:
    """late_ns: in order."""
    places = {"median_us": len(late_ns) // 2, "p99_us": len(late_ns) * 99 // 100, "max_us": -1}
    return {name: late_ns[place] / 1000 for name, place in places.items()}


def paced(send: Callable[[bytes], None], count: int, rate: int) -> None:
    """By absolute times, each PDU by itself."""
    start = time.monotonic()
    for number in range(count):
        if (early := start + number / rate - time.monotonic()) > 0:
            time.sleep(early)
        filled = struct.pack("=QQ", number, time.monotonic_ns())
        send(HEAD + filled + bytes(PDU_OCTETS - len(HEAD) - len(filled)))


def send_user(port: int, _qos: int) -> Callable[[bytes], None]:
    user: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.XPUB)
    user.connect(f"tcp://127.0.0.1:{port}")
    assert user.poll(int(START_S * 1000)), "nobody subscribes"
    return lambda pdu: user.send_multipart([b"v2x.", pdu])


def send_broker(port: int, qos: int) -> Callable[[bytes], None]:
    line = broker_line(port)
    number = 0

    def send(pdu: bytes) -> None:
        nonlocal number
        number += 1
        line.sendall(mute.publication(TOPIC, text(pdu), number=number if qos else 0))
        with contextlib.suppress(BlockingIOError):
            line.recv(1 << 16, socket.MSG_DONTWAIT)  # acknowledgements

    return send


def bursts(port: int, rate: int) -> None:
    """Until it is ended."""
    line = broker_line(port)
    bundle = b"".join(mute.publication(TOPIC, text(HEAD + bytes((n,)) * 294)) for n in range(int(rate * BUNDLE_S)))
    print("ready", flush=True)
    start = time.monotonic()
    while True:
        for number in range(int(BURST_S / BUNDLE_S)):
            time.sleep(max(0.0, start + number * BUNDLE_S - time.monotonic()))
            line.sendall(bundle)
        start += 1.0


def broker_line(port: int) -> socket.socket:
    line = socket.create_connection(("127.0.0.1", port))
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    line.sendall(CONNECT)
    assert line.recv(100)[:1] == b"\x20", "no CONNACK"
    return line


def text(pdu: bytes) -> bytes:
    return b"sender(2001): <%s>" % base64.b64encode(pdu)


def receive_user(port: int, count: int, _qos: int) -> list[int]:
    user: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.SUB)
    user.subscribe(b"v2x.")
    user.rcvtimeo = int(START_S * 1000)
    monitor = user.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED)
    user.connect(f"tcp://127.0.0.1:{port}")
    assert monitor.poll(int(START_S * 1000)), "nobody publishes"
    print("ready", flush=True)
    late: list[int] = []
    while len(late) < count:
        try:
            pdu = user.recv_multipart()[1]
        except zmq.Again:
            break
        note(late, pdu)
        user.rcvtimeo = int(QUIET_S * 1000)
    return late


def receive_broker(port: int, count: int, qos: int) -> list[int]:
    late: list[int] = []
    client = Client(port, "receiver", host="127.0.0.1")
    paho = client.paho
    client.subscribe("v2x/btp/+", qos=qos)
    paho.loop_stop()  # its thread: from here on there is one
    last = time.monotonic() + START_S

    def take(_client: object, _userdata: object, message: object) -> None:
        nonlocal last
        payload: bytes = message.payload  # type: ignore[attr-defined]
        note(late, base64.b64decode(payload[payload.index(b"<") + 1 : -1]))
        last = time.monotonic() + QUIET_S

    paho.on_message = take
    print("ready", flush=True)
    while len(late) < count and time.monotonic() < last:
        paho.loop(0.1)
    return late


def note(late_ns: list[int], pdu: bytes) -> None:
    late_ns.append(time.monotonic_ns() - int(struct.unpack_from("=Q", pdu, AT_TIME)[0]))


if __name__ == "__main__":
    sys.exit(main())
