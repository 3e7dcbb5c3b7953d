"""Options of the client's ZeroMQ sockets, and the error without a station."""

import time
from collections.abc import Sequence
from typing import Any

import zmq

from captain_client.address import Address
from captain_client.arguments import check_texts
from captain_client.errors import StationError, UnreachableError
from captain_client.requests import STATUS, Outgoing, Request, Requests, check_type

ANSWER_S = 3.0  # timeout of the station: three statuses of one second each are missing
CONFIRM_S = 15.0  # timeout of confirms: a message in JSON may wait 10 s for the station's encoder
# Messages that libzmq queues for a slow program: 10 s at 1,000 per second. Confirms and statuses of an idle program
# take at most 1,000 places, some 2 MB.
HIGH_WATER, HIGH_WATER_OF_REPORTS = 10_000, 1_000
LINGER_MS = 1_000  # time at the end for requests that libzmq has not yet written
MOST_OCTETS = 1 << 20  # longest frame; a status of a hundred interfaces has 100 kB
# ZMTP heartbeats detect a station that has lost its power or network: TCP does not notice.
HEARTBEAT_MS, HEARTBEAT_TIMEOUT_MS = 1_000, 3_000
CONFIRM = b"confirm."
CONNECTIONS = "inproc://connections"  # events of libzmq: new connections of the PUSH socket
EVENT_MS = 100  # time limit for the event of a connection, which libzmq sends some us after the socket is writable
# The collector may end a context before its sockets, and libzmq then waits for them without end. A client that its
# program does not close stays here until the end of the process.
OPEN: set["zmq.Context[Any]"] = set()
AT_ONCE = 256  # messages that are read before the program goes on


def connect(end: "zmq.Socket[Any]", url: str, *topics: bytes, most: int = HIGH_WATER) -> None:
    """Set the options of a SUB or PUSH socket, subscribe it to topics, and connect it in the background.

    url  ZeroMQ address of the other end.

    Raises ValueError if the address is invalid.
    """
    end.set(zmq.RCVHWM, most)
    end.set(zmq.LINGER, LINGER_MS if end.type == zmq.PUSH else 0)
    end.set(zmq.MAXMSGSIZE, MOST_OCTETS)
    end.set(zmq.IPV6, 1)
    end.set(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    end.set(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    end.set(zmq.HEARTBEAT_TTL, HEARTBEAT_TIMEOUT_MS)
    if end.type == zmq.PUSH:
        end.set(zmq.IMMEDIATE, 1)  # accept messages only while connected: queued ones would be lost with the process
    for topic in topics:
        end.set(zmq.SUBSCRIBE, topic)
    try:
        end.connect(url)
    except zmq.ZMQError as error:
        raise ValueError(f"{url}: invalid host or port: {error}") from error


def connections_of(push: "zmq.Socket[Any]") -> "zmq.Socket[bytes]":
    """Return a socket that gets an event at each new connection of a PUSH socket; call it before connect().

    A connection counts after the handshake: a proxy without its station accepts and ends ten connections per second.
    """
    push.monitor(CONNECTIONS, zmq.EVENT_HANDSHAKE_SUCCEEDED)
    connections: zmq.Socket[bytes] = push.context.socket(zmq.PAIR, socket_class=zmq.Socket)
    connections.set(zmq.RCVHWM, 0)  # a full queue of events would stop all sockets of the context
    connections.connect(CONNECTIONS)
    return connections


def has_connected(connections: "zmq.Socket[bytes]", wait_ms: int = 0) -> bool:
    """Return True if there is a new connection since the last call, or within wait_ms."""
    found = False
    while connections.poll(0 if found else wait_ms):
        connections.recv_multipart()
        found = True
    return found


def ask_for_status(reports: "zmq.Socket[bytes]") -> None:
    """Subscribe to statuses again: the station answers with one, after it has all earlier subscriptions."""
    reports.unsubscribe(STATUS)
    reports.subscribe(STATUS)


def check_open(end: "zmq.Socket[Any]") -> None:
    """Raise StationError if a socket is closed."""
    if end.closed:
        raise StationError("the client or its subscription is closed", "use it in its `with` block")


def offered(push: "zmq.Socket[bytes]", requests: Requests, kind: str, out: Outgoing) -> Request | None:
    """Send a request if libzmq takes it at once, and return it; None if the connection has ended."""
    request, frames = requests.open(kind, out)
    try:
        push.send_multipart(frames, zmq.NOBLOCK)
    except zmq.Again:
        requests.forget(request)
        return None
    return request


def topics_of(kind: str, names: Sequence[str]) -> tuple[bytes, ...]:
    """Return the topics of a kind of report, such as `frame`, by name; all of the kind without names.

    Raises ValueError if a name is not a text.
    """
    check_texts("interfaces", names)
    return tuple(f"{kind}.{name}.".encode() for name in names) or (f"{kind}.".encode(),)


def topics_of_types(kind: str, types: Sequence[str]) -> tuple[bytes, ...]:
    """Return the topics of a kind of report by message type. Raises ValueError for an invalid type."""
    check_texts("types", types)
    return topics_of(kind, [check_type(one) for one in types])


def ms_until(deadline: float) -> int:
    """Return the milliseconds until a time of the monotonic clock in seconds, rounded up; 0 if it has passed."""
    left = deadline - time.monotonic()
    return int(left * 1000) + 1 if left > 0 else 0


def unreachable(address: Address, port: int, why: str) -> UnreachableError:
    """Return the error for a port without a station. why: error of a TCP connection; empty if the port is open."""
    what = f"no station answers at {address.host}:{port}: {why or 'the port is open, but not that of a station'}"
    return UnreachableError(what, "start one with `captain run`, or give HOST:PORT, with the first of its four ports")
