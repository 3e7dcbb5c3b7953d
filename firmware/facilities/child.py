"""Facilities process: a loop over the station's channel and the received messages."""

import os
import socket
import time
from typing import Any, cast

import zmq

from board.runtime.child import MAX_MESSAGE
from board.runtime.errors import StationError
from drivers.reason import Reason
from firmware.codec import library
from firmware.facilities.converting import Converter
from firmware.facilities.encoding import Encoder, FaultsError
from firmware.facilities.exchange import Ask, Received, packed, parts_of

NICE = 5  # the station's routing runs first
AT_ONCE = 16  # messages of one socket that are handled before those of the other one
QUEUE = 256  # received messages that wait in libzmq
LOOK_S = 0.5  # interval of the checks for another message library


def serve(channel: socket.socket) -> None:
    """Answer the station's requests and convert received messages, until the station closes the channel."""
    os.nice(NICE)
    with zmq.Context() as context:
        Service(channel, context).run()


class Service:
    """Loop of the facilities process.

    channel  socket to the station.

    It ends when its message library is replaced, as by `make codec`. The station then starts it with the new one.
    """

    def __init__(self, channel: socket.socket, context: zmq.Context[zmq.Socket[bytes]]) -> None:
        self._channel = channel
        self._received = context.socket(zmq.SUB)
        self._received.set(zmq.RCVHWM, QUEUE)
        self._received.set(zmq.LINGER, 0)
        self._received.subscribe(b"")
        self._address = ""
        self._wanted: frozenset[bytes] = frozenset()
        self._done = self._lost = 0
        self._why = ""  # reason why nothing can be encoded or decoded
        self._loaded = self._seen = library.stamp()
        self._look_at = time.monotonic() + LOOK_S
        self._codec: tuple[Encoder, Converter] | None = None
        try:
            codec = library.load()
            self._codec = Encoder(codec), Converter(codec)
        except StationError as error:
            self._why = error.message

    def run(self) -> None:
        poller = zmq.Poller()
        poller.register(self._channel, zmq.POLLIN)
        poller.register(self._received, zmq.POLLIN)
        with self._received:
            while self._answer() and not self._is_replaced():
                if not self._convert():
                    poller.poll(int(LOOK_S * 1000))

    def _is_replaced(self) -> bool:
        """Return whether there is another library that has not changed since the last check: it is complete."""
        if time.monotonic() < self._look_at:
            return False
        self._look_at = time.monotonic() + LOOK_S
        before, self._seen = self._seen, library.stamp()
        return self._seen == before and self._seen not in (self._loaded, None)

    def _answer(self) -> bool:
        """Handle some messages of the station. Return False when it has closed the channel."""
        for _ in range(AT_ONCE):
            try:
                message = self._channel.recv(MAX_MESSAGE, socket.MSG_DONTWAIT)
            except BlockingIOError:
                break
            if not message:
                return False
            kind, *parts = parts_of(message)
            if kind == "ask":
                self._channel.send(self._encoded(Ask(*cast("tuple[Any, ...]", parts[0]))))
            else:
                self._want(*cast("tuple[str, tuple[bytes, ...]]", parts))
        return True

    def _want(self, address: str, topics: tuple[bytes, ...]) -> None:
        if address != self._address:
            self._received.connect(address)
            self._address = address
        self._wanted = frozenset(topics)

    def _encoded(self, ask: Ask) -> bytes:
        if self._codec is None:
            return packed("refused", ask.number, Reason.NO_LIBRARY.value, self._why, ())
        try:
            return packed("pdu", ask.number, *self._codec[0].encode(ask))
        except FaultsError as error:
            return packed("refused", ask.number, Reason.BAD_JSON.value, error.message, error.faults)

    def _convert(self) -> bool:
        """Convert received messages and publish their JSON. Return True if there may be more."""
        before = self._done
        for _ in range(AT_ONCE):
            try:
                message = self._received.recv(zmq.NOBLOCK)
            except zmq.Again:
                break
            one = Received(*cast("tuple[Any, ...]", parts_of(message)))
            self._lost += one.number - self._done - 1
            self._done = one.number
            if self._codec is None:
                self._lost += 1
            else:
                for topic, body in self._codec[1].convert(one, self._wanted):
                    self._channel.send(packed("json", topic, body))
        if self._done != before:
            self._channel.send(packed("done", self._done, self._lost))
        return self._done == before + AT_ONCE
