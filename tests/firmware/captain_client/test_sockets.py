"""Sockets of the client: new connections, and a proxy without its station."""

import socket
from collections.abc import Iterator
from typing import TypeAlias

import pytest
import zmq

from captain_client.sockets import connections_of, has_connected
from tests.system.station import PATIENCE

Socket: TypeAlias = "zmq.Socket[bytes]"

PATIENCE_MS = int(PATIENCE * 1000)
ENDS = 3_000  # more than the events that libzmq queues by default
AT_A_TIME = 50  # connections


@pytest.fixture
def context() -> Iterator["zmq.Context[Socket]"]:
    context: zmq.Context[Socket] = zmq.Context()
    yield context
    context.destroy(linger=0)


@pytest.fixture
def push(context: "zmq.Context[Socket]") -> Iterator[Socket]:
    with context.socket(zmq.PUSH) as push:
        push.set(zmq.IMMEDIATE, 1)
        push.set(zmq.RECONNECT_IVL, 1)
        push.set(zmq.LINGER, 0)
        yield push


@pytest.fixture
def connections(push: Socket) -> Iterator[Socket]:
    with connections_of(push) as connections:
        yield connections


@pytest.fixture
def pull(context: "zmq.Context[Socket]") -> Iterator[Socket]:
    with context.socket(zmq.PULL) as pull:
        pull.set(zmq.RCVTIMEO, PATIENCE_MS)
        yield pull


def test_proxy_that_accepts_and_ends_connections_causes_no_event_and_its_station_gets_messages_afterwards(
    push: Socket, connections: Socket, pull: Socket
):
    with socket.create_server(("127.0.0.1", 0)) as proxy:
        proxy.settimeout(PATIENCE)
        url = f"tcp://127.0.0.1:{proxy.getsockname()[1]}"
        for _ in range(AT_A_TIME):
            push.connect(url)
        for _ in range(ENDS):
            proxy.accept()[0].close()
    assert not has_connected(connections)
    pull.bind(url)
    assert push.poll(PATIENCE_MS, zmq.POLLOUT)
    push.send(b"cam")
    assert pull.recv() == b"cam"
    assert has_connected(connections, PATIENCE_MS)


def test_queue_of_events_has_no_limit_because_libzmq_waits_at_a_full_one(connections: Socket):
    # With a limit, the thread of libzmq waits at event 2,001, and all sockets of the context stop.
    assert connections.get(zmq.RCVHWM) == 0
