"""A receiver at an I2C bus: the bus blocks, so a process of its own asks it again and again, and passes octets on."""

import json
import select
import socket
from collections import deque
from collections.abc import Callable, Sequence

from board.child import MAX_MESSAGE
from board.errors import InterfaceError
from board.i2c import Bus
from board.loop import Loop
from board.worker import Worker
from drivers.gnss_options import GnssOptions
from drivers.wire.ddc import Ddc

WORKER = "gnss-bus"
LOOK_S = 0.02  # between two questions whether something waits: a tenth of an epoch at 5 Hz
EARLY = 4  # frames that wait for the process to run: the first question, asked a few times
AT_ONCE = 16  # transfers before it is looked for something to write

# What a message to the station begins with.
OCTETS, ERROR = b"o", b"e"


class BusLine:
    """drivers.gnss_port.Line: the station's side.

    command  of the process, as Worker has it.
    """

    def __init__(
        self,
        loop: Loop,
        options: GnssOptions,
        received: Callable[[bytes], None],
        broken: Callable[[InterfaceError], None],
        command: Sequence[str] = (),
    ) -> None:
        self.dropped = 0
        self.path = options.i2c
        self._settings = json.dumps({"bus": options.i2c, "address": options.i2c_address}).encode()
        self._early: deque[bytes] = deque()
        self._received = received
        self._broken = broken
        self._worker = Worker(loop, WORKER, self._message, self._changed, command=command)

    def open(self, baud: int) -> None:
        """Start the process; what is written before it runs waits for it."""
        self._worker.start()

    def write(self, frame: bytes) -> None:
        if not self._worker.is_up:
            self._early.append(frame)
            if len(self._early) > EARLY:
                self._early.popleft()
                self.dropped += 1
        elif not self._worker.send(frame):
            self.dropped += 1

    def close(self) -> None:
        self._early.clear()
        self._worker.stop()

    def _message(self, message: bytes) -> None:
        if message[:1] == OCTETS:
            self._received(message[1:])
        else:
            self._broken(InterfaceError(*json.loads(message[1:])))

    def _changed(self, is_up: bool, why: str) -> None:
        if is_up:
            self._worker.send(self._settings)
            early = list(self._early)
            self._early.clear()
            for frame in early:
                self.write(frame)
        else:
            self._broken(InterfaceError(f"{self.path}: the process that reads it has ended: {why}"))


def serve(channel: socket.socket) -> None:
    """The process's side: the bus's octets one way, frames the other."""
    settings = json.loads(channel.recv(MAX_MESSAGE) or b"{}")
    if settings:
        run(channel, lambda: Ddc(Bus(settings["bus"]), settings["address"]))


def run(channel: socket.socket, make: Callable[[], Ddc], look_s: float = LOOK_S) -> None:
    """Until the station closes its end. What goes wrong at the bus is told, and is the end."""
    try:
        ddc = make()
        while True:
            if select.select([channel], [], [], look_s)[0]:
                frame = channel.recv(MAX_MESSAGE)
                if not frame:
                    return
                ddc.write(frame)
            for _ in range(AT_ONCE):
                octets = ddc.read()
                if not octets:
                    break
                channel.send(OCTETS + octets)
    except InterfaceError as error:
        channel.send(ERROR + json.dumps([error.message, error.hint]).encode())
        channel.recv(MAX_MESSAGE)  # until it is heard: the end of a process would be told first
