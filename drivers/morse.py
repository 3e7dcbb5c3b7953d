"""Morse code as an interface: PDUs that one can hear, or see at a line. The template for a new one: README.md."""

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Annotated, BinaryIO, ClassVar

from board.describe import Range
from board.description import LineDescription
from board.errors import ConfigurationError, InterfaceError, RequestError
from board.line import Blinker, OutputLine
from board.loop import Timer
from drivers.contract import BUSY, LATER, Can, Capabilities, Host, Sent, Shared
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import morse

POLL_S = 0.2  # between two looks at the directory; a message takes longer to speak
MAX_FILE = 5_000_000  # octets: the longest PDU at the slowest unit takes 4 million
SLICE = 65536  # octets of a file that are heard in one turn
SAMPLE = 1024  # octets of a file that is no message, to look at
KEEP = 100  # files that nobody has heard; before one more is written, the oldest is removed


@dataclass(frozen=True)
class MorseOptions:
    """Options of an interface with driver = "morse".

    speak    directory that WAV files are written to.
    listen   directory that WAV files are heard from, and removed; another station's speak.
    chip     GPIO chip by label (pinctrl-bcm2711), name or path.
    line     of that chip, active while it sounds.
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
        self._dev = shared.machine.dev
        self._opened = ExitStack()
        self._files: set[BinaryIO] = set()  # that are being spoken or heard
        self._look_timer: Timer | None = None
        self._speak_timer: Timer | None = None

    def start(self, host: Host) -> None:
        self._host = host
        self._blinker: Blinker | None = None
        self._ways = 0  # that the message still has to go: a file, a line
        for path in filter(None, (self._options.speak, self._options.listen)):
            if not (os.path.isdir(path) and os.access(path, os.R_OK | os.W_OK | os.X_OK)):
                raise InterfaceError(f"{path}: no directory that can be read and written", f"mkdir -p {path}")
        if self._options.line is not None:
            line = OutputLine(
                LineDescription(chip=self._options.chip, offset=self._options.line, initial="inactive"), self._dev
            )
            self._opened.callback(line.close)
            self._blinker = Blinker(host.loop, line)
            self._opened.callback(self._blinker.stop)
        if self._options.listen:
            self._look_timer = host.loop.after(0.0, self._look)
        host.link(True, f"a dot lasts {self._options.unit_ms} ms")

    def send(self, request: Request) -> Sent:
        if len(request.pdu) > morse.MAX_PDU:
            raise RequestError(f"{len(request.pdu)} octets take too long in Morse code: at most {morse.MAX_PDU}")
        if self._ways:
            return BUSY
        durations = morse.encode(request.pdu)
        try:
            if self._options.speak:
                self._speak(request, morse.wav(durations, self._options.unit_ms))
        except OSError as error:
            self._fail(self._options.speak, error)
            return BUSY
        if self._blinker is not None:
            self._ways += 1
            unit_s = self._options.unit_ms / 1000
            self._blinker.blink([units * unit_s for units in durations], lambda error: self._blinked(request, error))
        return LATER

    def refresh(self) -> None:
        """Nothing is counted elsewhere."""

    def stop(self) -> None:
        for timer in (self._look_timer, self._speak_timer):
            if timer is not None:
                timer.cancel()
        for file in self._files.copy():
            self._close(file)
        self._opened.close()

    def _speak(self, request: Request, slices: Iterator[bytes]) -> None:
        """Begin a file, of which each turn of the loop writes a slice."""
        speak = self._options.speak
        for old in _files(speak)[: 1 - KEEP]:
            os.unlink(old)
        # Who listens never sees a file that is half written.
        file = open(os.path.join(speak, "part"), "wb")  # noqa: SIM115 closed by its last slice or stop()
        self._files.add(file)
        self._ways += 1
        self._speak_timer = self._host.loop.after(0.0, lambda: self._go_on(request, file, slices))

    def _go_on(self, request: Request, file: BinaryIO, slices: Iterator[bytes]) -> None:
        speak = self._options.speak
        try:
            if samples := next(slices, b""):
                file.write(samples)
                self._speak_timer = self._host.loop.after(0.0, lambda: self._go_on(request, file, slices))
                return
            self._close(file)
            os.rename(file.name, os.path.join(speak, f"{time.time_ns()}.wav"))
        except OSError as error:
            self._fail(speak, error)
            return
        self._done(request)

    def _blinked(self, request: Request, error: InterfaceError | None) -> None:
        if error is not None:
            self._host.fail(error)
            return
        self._done(request)

    def _done(self, request: Request) -> None:
        """One way is done: the message has left when the last is."""
        self._ways -= 1
        if not self._ways:
            self._host.confirm(request)
            self._host.writable()

    def _look(self) -> None:
        """Look for a file, five times a second, and begin to hear the oldest."""
        try:
            for path in _files(self._options.listen)[:1]:
                file = open(path, "rb")  # noqa: SIM115 closed by its last slice or stop()
                self._files.add(file)
                os.unlink(path)
                self._hear(file, morse.Ear())
                return
        except OSError as error:
            self._fail(self._options.listen, error)
            return
        self._look_timer = self._host.loop.after(POLL_S, self._look)

    def _hear(self, file: BinaryIO, ear: morse.Ear, sample: bytes = b"") -> None:
        try:
            octets = file.read(SLICE)
        except OSError as error:
            self._fail(self._options.listen, error)
            return
        ear.receive(octets)
        sample = sample or octets[:SAMPLE]
        if octets and file.tell() < MAX_FILE:
            self._look_timer = self._host.loop.after(0.0, lambda: self._hear(file, ear, sample))
            return
        self._close(file)
        self._look_timer = self._host.loop.after(POLL_S, self._look)
        self._heard(ear, sample)

    def _close(self, file: BinaryIO) -> None:
        self._files.discard(file)
        file.close()

    def _heard(self, ear: morse.Ear, sample: bytes) -> None:
        pdu = morse.decode(ear.end())
        if isinstance(pdu, Reason):
            self._host.drop(pdu, sample)
        else:
            self._host.indicate(pdu, time.time_ns())

    def _fail(self, directory: str, error: OSError) -> None:
        self._host.fail(InterfaceError(f"{directory}: {error.strerror}"))


def _files(directory: str) -> list[str]:
    with os.scandir(directory) as entries:
        return sorted(entry.path for entry in entries if entry.name.endswith(".wav") and entry.is_file())
