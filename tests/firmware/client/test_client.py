"""A user's sockets: what they do when the line to the station dies without a word."""

import time

import pytest
import zmq

from board.runtime.errors import StationError
from captain_client import sockets
from firmware.client import client
from tests.broker.proxy import Proxy

PATIENCE_S = 10.0  # reached only by a test that fails
HOST = "127.0.0.1"


def test_a_line_that_swallows_everything_is_noticed_and_replaced(monkeypatch):
    monkeypatch.setattr(sockets, "HEARTBEAT_MS", 100)
    monkeypatch.setattr(sockets, "HEARTBEAT_TIMEOUT_MS", 500)
    with client.session() as context, context.socket(zmq.PUB) as station:
        port = station.bind_to_random_port(f"tcp://{HOST}")
        with Proxy(port) as line:
            place = client.Address(HOST, to_users=line.port)
            subscriber = client.subscribe(context, place, line.port, "")

            def arrives() -> bool:
                station.send(b"v2x.cam.")
                return bool(subscriber.poll(5))

            until(arrives)
            before = line.accepted
            line.go_dark()  # as when the other machine loses its power: no end of the connection is told
            until(lambda: line.accepted > before)
            line.light()
            line.cut()
            list(client.waiting(subscriber))
            until(arrives)


def test_address_that_zeromq_refuses_raises_a_station_error():
    with client.session() as context, pytest.raises(StationError, match=r"^tcp://\.\.:5556: invalid host or port"):
        client.subscribe(context, client.Address(), 5556, url="tcp://..:5556")


def until(holds) -> None:
    ends = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < ends, "it never came to hold"
        time.sleep(0.002)
