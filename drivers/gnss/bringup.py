"""Bring-up of a u-blox receiver: identification, baud rate, configuration.

Each step is a question that the receiver must answer. If an answer is missing, the bring-up fails with an error that
names the step.
"""

from collections import deque
from collections.abc import Callable

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop, Timer
from drivers.gnss import settings
from drivers.gnss.configuration import Configuration, Done
from drivers.gnss.conversation import Conversation
from drivers.gnss.options import FACTORY_BAUD, GnssOptions
from drivers.gnss.port import ReceiverLine
from drivers.wire.ublox import ubx
from drivers.wire.ublox.health import MonVer
from drivers.wire.ublox.messages import Message, encode
from drivers.wire.ublox.ubx import Kind
from drivers.wire.ublox.values import RAM, ValSet

# Seconds from a change of the baud rate until the receiver listens at the new one. It acknowledges at the old rate, at
# the new one, or not at all, so the acknowledgement is not awaited.
CHANGE_S = 0.3
IDENTIFY_TRIES = 3


class Bringup:
    """One bring-up. It ends with a call of done() or failed(); failed() may be called inside start()."""

    def __init__(
        self,
        loop: Loop,
        talk: Conversation,
        port: ReceiverLine,
        options: GnssOptions,
        done: Done,
        failed: Callable[[InterfaceError], None],
    ) -> None:
        self._loop = loop
        self._talk = talk
        self._port = port
        self._options = options
        self._done = done
        self._failed = failed
        self._baud = settings.baud(options)
        self._bauds = deque([options.rate_baud] if self._baud is None else [options.rate_baud, FACTORY_BAUD])
        self._tried: list[int] = []
        self._timer: Timer | None = None

    def start(self) -> None:
        """Open the port and ask for the receiver's version. Raises InterfaceError if the port cannot be opened."""
        self._open(self._bauds.popleft())

    def close(self) -> None:
        """Abort the bring-up; idempotent."""
        self._talk.close()
        if self._timer is not None:
            self._timer.cancel()

    # Identification

    def _open(self, baud: int) -> None:
        self._tried.append(baud)
        self._port.open(baud)
        self._talk.ask(ubx.encode(Kind.MON_VER), _is_version, self._identified, IDENTIFY_TRIES)

    def _open_again(self, baud: int) -> None:
        try:
            self._open(baud)
        except InterfaceError as error:
            self._failed(error)

    def _identified(self, answer: Message | None) -> None:
        if isinstance(answer, MonVer):
            self._change_baud(answer)
        elif self._bauds:
            self._open_again(self._bauds.popleft())
        else:
            rates = "" if self._baud is None else f" at {' and '.join(map(str, dict.fromkeys(self._tried)))} baud"
            self._failed(
                InterfaceError(
                    f"{self._port.path}: no u-blox receiver answers{rates}",
                    'a receiver that only speaks NMEA needs kind = "nmea"',
                )
            )

    # Baud rate

    def _change_baud(self, version: MonVer) -> None:
        if self._baud is None or self._tried[-1] == self._options.rate_baud:
            talk, path = self._talk, self._port.path
            Configuration(talk, path, self._options, version, self._done, self._failed).start()
            return
        self._bauds.clear()
        self._port.write(encode(ValSet(RAM, self._baud.items)))
        self._timer = self._loop.after(CHANGE_S, lambda: self._open_again(self._options.rate_baud))


def _is_version(message: Message) -> bool:
    return isinstance(message, MonVer)
