"""Receiver on an I2C bus: a worker process polls the bus and passes octets on.

Access to the bus blocks, so it must not be in the station's process.
"""

import json
import select
import socket
from collections import deque
from collections.abc import Callable, Sequence

from board.i2c import Bus
from board.runtime.child import MAX_MESSAGE
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from board.runtime.worker import Worker
from drivers.gnss.options import GnssOptions
from drivers.wire.ddc import Ddc

WORKER = "gnss-bus"
LOOK_S = 0.02  # interval in which the bus is polled: a tenth of an epoch at 5 Hz
EARLY = 4  # frames kept until the process runs: enough for the repeated first question
AT_ONCE = 16  # most reads in a row before the process checks for frames to write

# First octet of a message to the station: octets of the receiver, or an error.
OCTETS, ERROR = b"o", b"e"


class BusLine:
    """Line to a receiver on an I2C bus, the station's side; implements drivers.gnss.port.ReceiverLine.

    received  called with received octets.
    broken    called with an error when the bus or the process fails.
    command   command line of the process, for Worker; empty: this program.
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
        self.is_open = False
        self.path = options.i2c
        self._settings = json.dumps({"bus": options.i2c, "address": options.i2c_address}).encode()
        self._early: deque[bytes] = deque()
        self._received = received
        self._broken = broken
        self._worker = Worker(loop, WORKER, self._message, self._changed, command=command)

    def open(self, baud: int) -> None:
        """Start the process; the baud rate is ignored. Up to EARLY frames that are written before it runs are kept."""
        self.is_open = True
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
        self.is_open = False
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
            self._broken(InterfaceError(f"{self.path}: the child process that reads the receiver has ended: {why}"))


def serve(channel: socket.socket) -> None:
    """Run the process: pass octets of the bus to the station, and frames of the station to the bus."""
    settings = json.loads(channel.recv(MAX_MESSAGE) or b"{}")
    if settings:
        run(channel, lambda: Ddc(Bus(settings["bus"]), settings["address"]))


def run(channel: socket.socket, make: Callable[[], Ddc], look_s: float = LOOK_S) -> None:
    """Pass octets on until the station closes its end of the channel. An error of the bus is reported and ends it.

    make    function that opens the bus.
    look_s  interval in which the bus is polled.
    """
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
        channel.recv(MAX_MESSAGE)  # wait until the station has read the error: else it would report the process's end
