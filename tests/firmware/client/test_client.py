"""A user's sockets: what they do when the line to the station dies without a word."""

import time

import zmq

from firmware.client import client
from tests.broker.proxy import Proxy

PATIENCE_S = 10.0  # reached only by a test that fails
HOST = "127.0.0.1"


def test_a_line_that_swallows_everything_is_noticed_and_replaced(monkeypatch):
    monkeypatch.setattr(client, "HEARTBEAT_MS", 100)
    monkeypatch.setattr(client, "HEARTBEAT_TIMEOUT_MS", 500)
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


def until(holds) -> None:
    ends = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < ends, "it never came to hold"
        time.sleep(0.002)
