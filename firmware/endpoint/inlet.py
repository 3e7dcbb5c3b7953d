"""Inlet: a socket that receives envelope, PDU and (PULL only) options from users."""

import logging
from typing import Protocol

import zmq
from zmq.backend import Socket as PlainSocket

from board.runtime.errors import InterfaceError, RequestError
from drivers.message import ITS_HEADER, MAX_PDU, MessageType
from drivers.reason import Reason
from firmware.endpoint.peers.door import Door, descriptor_of, is_readable
from firmware.endpoint.publisher import beat, bind
from firmware.routing import options
from firmware.routing.router import Routing

_recv = PlainSocket.recv
NOBLOCK = int(zmq.NOBLOCK)

# Number of messages taken per turn of the loop: 64 of 10 us each delay an interface by less than a millisecond.
BATCH = 64
# Number of messages that libzmq queues for each connection. A user's PUB socket drops messages if the queues are full.
# Half a burst of 20,000 fits into the queue of the SUB socket; the other half fits into TCP's buffers or is taken
# meanwhile. A queue for all of it would cost 10 MB. A user's PUSH socket waits instead, so PULL has a short queue.
SUB_HWM = 10_000
PULL_HWM = 1_000
# Octets. libzmq ends the connection at a longer frame, without a count. A shorter frame that is longer than a PDU is
# refused with a reason.
MAX_FRAME = 65536
# Number of frames in a message. Only three are used; a connection that sends a message with more than this is ended.
MAX_FRAMES = 64

log = logging.getLogger("captain.inlet")


class JsonSide(Protocol):
    """Receiver of messages in JSON (firmware.endpoint.facilities.Facilities)."""

    def request(self, kind: MessageType | None, body: bytes, where: str, asked: options.Parsed) -> None:
        """Encode JSON and send it. kind: type of the envelope; None for `v2x.`."""


class Inlet:
    """Socket for messages from users, read in batches: SUB (subscribed to everything) or PULL.

    kind           zmq.SUB or zmq.PULL.
    name           place of its drop counters: from_users or pull.
    json           takes messages whose options say that they are JSON. None: a third frame is ignored.
    is_strict      True refuses a PDU whose messageID does not match its envelope.

    Raises InterfaceError if the address cannot be bound.
    """

    def __init__(
        self,
        routing: Routing,
        context: zmq.Context[zmq.Socket[bytes]],
        kind: int,
        address: str,
        name: str,
        json: JsonSide | None = None,
        is_strict: bool = False,
    ) -> None:
        self._loop = routing.loop
        self._name = name
        self._topics = routing.topics
        self._router = routing.router
        self._json = json
        self._is_strict = is_strict
        self._is_scheduled = False
        self._socket = context.socket(kind)
        self._socket.set(zmq.RCVHWM, SUB_HWM if kind == zmq.SUB else PULL_HWM)
        self._socket.set(zmq.MAXMSGSIZE, MAX_FRAME)
        self._socket.set(zmq.LINGER, 0)
        self._socket.set(zmq.IPV6, int("[" in address))
        if kind == zmq.SUB:
            self._socket.set(zmq.SUBSCRIBE, b"")
        beat(self._socket)
        self.door = Door(routing.loop, context, self._socket, name, routing.drops)
        self._is_skipping = False  # True while the remaining frames of a message with too many frames are discarded
        try:
            bind(self._socket, address, f"endpoint.{name}")
        except InterfaceError:
            self.door.close()
            raise
        routing.loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int = 0) -> None:
        """Take a batch of messages. The descriptor is edge-triggered, so the next turn of the loop takes the rest."""
        if not self._is_scheduled:
            self._go_on()

    def _go_on(self) -> None:
        self._is_scheduled = not self._socket.closed and self._take_batch(BATCH)
        if self._is_scheduled:
            self._loop.soon(self._go_on)

    def drain(self, most: int) -> bool:
        """Take up to `most` messages now; libzmq returns one of each connection in turn.

        Returns False if this ended inside a message with too many frames.
        """
        if not self._socket.closed and is_readable(self._socket):
            self._take_batch(most)
        return not self._is_skipping

    def finish(self, until: float) -> None:
        """Take the messages that have arrived, then close the socket, because the station stops.

        until  latest time to take messages, on the loop's clock.
        """
        while self._take_batch(BATCH) and self._loop.clock() < until:
            pass
        if is_readable(self._socket):
            log.warning("%s: received messages discarded: the station stops", self._name)
        self.close()

    def close(self) -> None:
        """Close the socket; a second call has no effect."""
        if not self._socket.closed:
            self._loop.remove(self)
            self.door.close()
            self._socket.close(0)

    def _take_batch(self, size: int) -> bool:
        """Take up to `size` messages. Return True if there may be more."""
        socket, door = self._socket, self.door
        for taken in range(size):
            try:
                envelope = _recv(socket, NOBLOCK, False)
            except zmq.Again:
                return False
            if self._is_skipping:
                self._is_skipping = envelope.more
                continue
            door.heard.add(descriptor := descriptor_of(envelope))
            if not envelope.more:
                self._router.refuse_message(Reason.ONE_FRAME, envelope.bytes, self._name)
                continue
            pdu = _recv(socket, NOBLOCK, False)
            if descriptor < 0:
                door.unnamed += len(envelope) + len(pdu)
            if pdu.more:
                self._take_with_more(envelope.bytes, pdu.bytes)
            else:
                self._take(envelope.bytes, pdu.bytes, options.NOTHING_ASKED)
            # After the first message of a batch, a poll is cheaper than a read that raises Again (half the time). Later
            # messages of a burst skip the poll.
            if not taken and not is_readable(socket):
                return False
        return True

    def _take(self, envelope: bytes, pdu: bytes, asked: options.Parsed) -> None:
        size = len(pdu)
        topics = self._topics
        kind = topics.by_envelope.get(envelope)
        if kind is None:
            if envelope != b"v2x.":
                self._refuse(Reason.BAD_ENVELOPE, envelope, asked)
                return
            if size < ITS_HEADER:
                self._refuse(Reason.SHORT_PDU if size else Reason.EMPTY_PDU, pdu, asked)
                return
            kind = topics.by_number[pdu[1]]
        elif not size:
            self._refuse(Reason.EMPTY_PDU, pdu, asked, kind)
            return
        elif self._is_strict and size < ITS_HEADER:
            self._refuse(Reason.SHORT_PDU, pdu, asked, kind)
            return
        elif self._is_strict and topics.by_number[pdu[1]].name != kind.name:
            self._refuse(Reason.HEADER_MISMATCH, pdu, asked, kind)
            return
        if size > MAX_PDU:
            self._refuse(Reason.LONG_PDU, pdu, asked, kind)
            return
        self._router.request(kind, pdu, self._name, asked)

    def _refuse(self, reason: Reason, sample: bytes, asked: options.Parsed, kind: MessageType | None = None) -> None:
        self._router.refuse_message(reason, sample, self._name, kind, asked.options.label)

    def _take_with_more(self, envelope: bytes, pdu: bytes) -> None:
        """Take a message of three or more frames. Frames after the third are read and discarded."""
        last = third = _recv(self._socket, NOBLOCK, False)
        frames = 3
        while last.more and frames < MAX_FRAMES:
            last = _recv(self._socket, NOBLOCK, False)
            frames += 1
        if last.more:
            self._is_skipping = True
            if (connection := self.door.connections.get(descriptor_of(third))) is not None:
                self.door.cut(connection, Reason.UNFINISHED, pdu, f"more than {MAX_FRAMES} frames in one message")
        if self._json is None:
            self._take(envelope, pdu, options.NOTHING_ASKED)
            return
        try:
            asked = options.parse(third.bytes)
        except RequestError as error:
            log.debug("%s: %s", self._name, error)
            label = options.label_of(third.bytes)
            self._router.refuse_message(Reason.BAD_OPTIONS, third.bytes, self._name, label=label, detail=str(error))
            return
        if asked.options.form == "octets":
            self._take(envelope, pdu, asked)
        elif envelope == b"v2x." or envelope in self._topics.by_envelope:
            self._json.request(self._topics.by_envelope.get(envelope), pdu, self._name, asked)
        else:
            self._refuse(Reason.BAD_ENVELOPE, envelope, asked)
