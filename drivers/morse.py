"""Morse code as an interface: PDUs that one can hear, or see at a line. The template for a new one: README.md."""

import os
import time
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Annotated, ClassVar

from board.describe import Range
from board.errors import ConfigurationError, InterfaceError, RequestError
from board.line import Blinker, OutputLine
from board.loop import Timer
from drivers.contract import Can, Capabilities, Host, Sent, Shared
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import morse

POLL_S = 0.2  # between two looks at the directory; a message takes longer to speak
MAX_FILE = 16_000_000  # octets: the longest PDU at the slowest unit takes 12 million
KEEP = 100  # files that nobody has heard; before one more is written, the oldest is removed


@dataclass(frozen=True)
class MorseOptions:
    """Options of an interface with driver = "morse".

    speak    directory that WAV files are written to.
    listen   directory that WAV files are heard from, and removed; another station's speak.
    line     GPIO line of a chip, active while it sounds.
    unit_ms  length of a dot.
    """

    speak: str = ""
    listen: str = ""
    chip: str = "gpiochip0"
    line: Annotated[int, Range(0, 1023)] | None = None
    unit_ms: Annotated[int, Range(5, 100)] = 20

    def __post_init__(self) -> None:
        if not (self.speak or self.listen) and self.line is None:
            raise ConfigurationError("a morse interface has neither speak nor listen nor line", "give one of them")


class Morse:
    """PDUs in dots and dashes."""

    Options: ClassVar[type] = MorseOptions

    def __init__(self, options: MorseOptions, shared: Shared) -> None:
        hears = Can.RECEIVE if options.listen else Can(0)
        sends = Can.TRANSMIT if options.speak or options.line is not None else Can(0)
        self.capabilities = Capabilities(hears | sends, "morse", morse.MAX_PDU)
        self._options = options
        self._opened = ExitStack()
        self._poll: Timer | None = None

    def start(self, host: Host) -> None:
        self._host = host
        self._blinker: Blinker | None = None
        for path in filter(None, (self._options.speak, self._options.listen)):
            if not (os.path.isdir(path) and os.access(path, os.R_OK | os.W_OK | os.X_OK)):
                raise InterfaceError(f"{path}: no directory that can be read and written", f"mkdir -p {path}")
        if self._options.line is not None:
            line = OutputLine(self._options.chip, self._options.line)
            self._opened.callback(line.close)
            self._blinker = Blinker(host.loop, line)
            self._opened.callback(self._blinker.stop)
        if self._options.listen:
            self._poll = host.loop.after(0.0, self._look)
        host.link(True, f"a dot lasts {self._options.unit_ms} ms")

    def send(self, request: Request) -> Sent:
        if len(request.pdu) > morse.MAX_PDU:
            raise RequestError(f"{len(request.pdu)} octets take too long in Morse code: at most {morse.MAX_PDU}")
        if self._blinker is not None and self._blinker.is_busy:
            return Sent.BUSY
        durations = morse.encode(request.pdu)
        try:
            if self._options.speak:
                self._write(morse.write_wav(durations, self._options.unit_ms))
        except OSError as error:
            self._host.fail(InterfaceError(f"{self._options.speak}: {error.strerror}"))
            return Sent.BUSY
        if self._blinker is None:
            return Sent.NOW
        unit_s = self._options.unit_ms / 1000
        self._blinker.blink([units * unit_s for units in durations], lambda error: self._done(request, error))
        return Sent.LATER

    def refresh(self) -> None:
        """Nothing is counted elsewhere."""

    def stop(self) -> None:
        if self._poll is not None:
            self._poll.cancel()
        self._opened.close()

    def _write(self, octets: bytes) -> None:
        speak = self._options.speak
        for old in _files(speak)[: 1 - KEEP]:
            os.unlink(old)
        part = os.path.join(speak, "part")  # who listens never sees a file that is half written
        with open(part, "wb") as file:
            file.write(octets)
        os.rename(part, os.path.join(speak, f"{time.time_ns()}.wav"))

    def _done(self, request: Request, error: InterfaceError | None) -> None:
        if error is not None:
            self._host.fail(error)
            return
        self._host.confirm(request)
        self._host.writable()

    def _look(self) -> None:
        self._poll = self._host.loop.after(POLL_S, self._look)
        try:
            for path in _files(self._options.listen)[:1]:
                with open(path, "rb") as file:
                    octets = file.read(MAX_FILE)
                os.unlink(path)
                self._hear(octets)
        except OSError as error:
            self._host.fail(InterfaceError(f"{self._options.listen}: {error.strerror}"))

    def _hear(self, octets: bytes) -> None:
        heard = morse.decode(morse.read_wav(octets))
        if isinstance(heard, Reason):
            self._host.drop(heard, octets)
        else:
            self._host.indicate(heard, time.time_ns())


def _files(directory: str) -> list[str]:
    with os.scandir(directory) as entries:
        return sorted(entry.path for entry in entries if entry.name.endswith(".wav") and entry.is_file())
