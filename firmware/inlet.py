"""A socket that user programs send to: two frames, an envelope and a PDU; a third with options where it is allowed."""

import logging

import zmq
from zmq.backend import Socket as PlainSocket

from board.errors import InterfaceError, RequestError
from board.loop import Loop
from drivers.message import ITS_HEADER, MAX_PDU, MessageType
from drivers.reason import Reason
from firmware import options
from firmware.drops import Drops
from firmware.peers.door import Door, descriptor_of, is_readable
from firmware.publisher import beat, bind
from firmware.router import Router
from firmware.topics import Topics

_recv = PlainSocket.recv
NOBLOCK = int(zmq.NOBLOCK)

# Messages taken in one turn: 64 of 10 us let an interface wait for less than a millisecond.
BATCH = 64
# A SUB's sender drops what it cannot hand over: half a burst of 20,000 fits here, the other half in TCP's buffers and
# in what is taken meanwhile. All of it would cost 10 MB. A PULL's sender waits.
SUB_HWM = 10_000
PULL_HWM = 1_000
# Octets. A file sent by mistake is refused with its reason; a client that sends more loses its connection, uncounted.
MAX_FRAME = 65536
# Frames of a message. Three have a meaning; a connection that sends more than this is ended.
MAX_FRAMES = 64

log = logging.getLogger("captain.inlet")


class Inlet:
    """A SUB (subscribed to everything) or PULL socket, drained a batch at a time.

    name           where its drops are counted: from_users or pull.
    takes_options  whether a third frame is read; without, it is ignored.
    is_strict      whether a PDU must have the messageID that its envelope names.
    """

    def __init__(
        self,
        loop: Loop,
        context: zmq.Context[zmq.Socket[bytes]],
        kind: int,
        address: str,
        name: str,
        topics: Topics,
        router: Router,
        drops: Drops,
        takes_options: bool = False,
        is_strict: bool = False,
    ) -> None:
        self._loop = loop
        self._name = name
        self._topics = topics
        self._router = router
        self._takes_options = takes_options
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
        self.door = Door(loop, context, self._socket, name, drops)
        self._is_skipping = False  # the rest of a message of too many frames
        try:
            bind(self._socket, address, f"endpoint.{name}")
        except InterfaceError:
            self.door.close()
            raise
        loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int = 0) -> None:
        """Take a batch; the descriptor tells of an edge only, so what is left is taken in the next turn."""
        if not self._is_scheduled:
            self._go_on()

    def _go_on(self) -> None:
        self._is_scheduled = not self._socket.closed and self._take_batch(BATCH)
        if self._is_scheduled:
            self._loop.soon(self._go_on)

    def drain(self, most: int) -> bool:
        """Take up to most messages now, one of each connection that has one before the second of any.

        Returns whether that was so: the rest of a message of too many frames may have been in the way.
        """
        if not self._socket.closed and is_readable(self._socket):
            self._take_batch(most)
        return not self._is_skipping

    def finish(self, until: float) -> None:
        """Take what has arrived, but no longer than until (the loop's clock), and close: the station stops."""
        while self._take_batch(BATCH) and self._loop.clock() < until:
            pass
        if is_readable(self._socket):
            log.warning("%s: messages that had arrived were not taken any more: the station stops", self._name)
        self.close()

    def close(self) -> None:
        """Idempotent."""
        if not self._socket.closed:
            self._loop.remove(self)
            self.door.close()
            self._socket.close(0)

    def _take_batch(self, size: int) -> bool:
        """Take up to size messages; whether there may be more."""
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
            # Asking is half as dear as running into Again: right where messages come one by one; a burst runs on.
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
        """Three frames and more: the third may be options, the rest is read so that the next message is whole."""
        last = third = _recv(self._socket, NOBLOCK, False)
        frames = 3
        while last.more and frames < MAX_FRAMES:
            last = _recv(self._socket, NOBLOCK, False)
            frames += 1
        if last.more:
            self._is_skipping = True
            if (connection := self.door.connections.get(descriptor_of(third))) is not None:
                self.door.cut(connection, Reason.UNFINISHED, pdu, f"more than {MAX_FRAMES} frames in one message")
        if not self._takes_options:
            self._take(envelope, pdu, options.NOTHING_ASKED)
            return
        try:
            asked = options.parse(third.bytes)
        except RequestError as error:
            log.debug("%s: %s", self._name, error)
            label = options.label_of(third.bytes)
            self._router.refuse_message(Reason.BAD_OPTIONS, third.bytes, self._name, label=label, detail=str(error))
            return
        self._take(envelope, pdu, asked)
