"""Program that tests start as the process of a receiver at an I2C bus.

The bus is the pty of a simulated receiver, accessed through the receiver's registers.
"""

import contextlib
import errno
import json
import os
import sys
import tty

from board.runtime.child import MAX_MESSAGE
from board.runtime.errors import InterfaceError
from board.runtime.worker import child
from drivers.gnss.bus import WORKER, run
from drivers.wire.ddc import Ddc

LOOK_S = 0.002


class PtyBus:
    """Registers fd, fe and ff of a receiver, whose stream comes from a pty."""

    def __init__(self, path):
        self._path = path
        self._end = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self._end)
        self._stream = b""

    def transfer(self, address, write, read):
        if address != 0x42:
            raise InterfaceError(f"no answer from {address:#04x} on {self._path}", "is it fitted?")
        try:
            if len(write) > 1:
                os.write(self._end, write)
                return b""
            if write == b"\xfd":
                self._fetch()
                return len(self._stream).to_bytes(2)
        except OSError as error:
            raise InterfaceError(f"{self._path}: the bus is stuck") from error
        octets, self._stream = self._stream[:read], self._stream[read:]
        return octets.ljust(read, b"\xff")

    def _fetch(self):
        with contextlib.suppress(BlockingIOError):
            octets = os.read(self._end, 4096)
            if not octets:  # the receiver's end is closed
                raise OSError(errno.EIO, os.strerror(errno.EIO))
            self._stream += octets


def serve(channel):
    settings = json.loads(channel.recv(MAX_MESSAGE))
    run(channel, lambda: Ddc(PtyBus(settings["bus"]), settings["address"]), LOOK_S)


if __name__ == "__main__":
    sys.exit(child(sys.argv, {WORKER: lambda: serve}))
