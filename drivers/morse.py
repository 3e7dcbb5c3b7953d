"""Driver for PDUs in Morse code, as WAV files or on a GPIO line.

It is the template for a new driver; README.md explains how to write one.
"""

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, BinaryIO, ClassVar

from board.description import LineDescription
from board.line import Blinker, OutputLine
from board.runtime.describe import Range
from board.runtime.errors import ConfigurationError, InterfaceError, RequestError
from board.runtime.loop import Timer
from drivers.contract import BUSY, LATER, Can, Capabilities, Host, Sent, Shared
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import morse

POLL_S = 0.2  # seconds between two looks into the directory; sending one message takes longer
MAX_FILE = 5_000_000  # octets read of one file: the longest PDU at the slowest unit takes 4 million
SLICE = 65536  # octets of a file that are decoded in one turn of the loop
SAMPLE = 1024  # octets of an undecodable file that are kept as the sample of its drop
KEEP = 100  # files that no station has read yet; the oldest is removed before one more is written


@dataclass(frozen=True)
class MorseOptions:
    """PDUs in Morse code: the template for a driver of your own.

    speak    folder for written WAV files.
    listen   folder of WAV files to read; they are removed. It is `speak` of another station.
    chip     GPIO chip by label (pinctrl-bcm2711), name or path.
    line     line of that chip, active while a dot or dash lasts. Left out: none.
    unit_ms  length of a dot.

    Raises ConfigurationError without speak, listen and line.
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
    """Driver for PDUs in Morse code."""

    Options: ClassVar[type] = MorseOptions

    def __init__(self, options: MorseOptions, shared: Shared) -> None:
        hears = Can.RECEIVE if options.listen else Can(0)
        sends = Can.TRANSMIT if options.speak or options.line is not None else Can(0)
        self.capabilities = Capabilities(hears | sends, "morse", morse.MAX_PDU)
        self._options = options
        self._dev = shared.machine.dev
        self._running: _RunningMorse | None = None

    def start(self, host: Host) -> None:
        """Check the directories and open the line.

        Raises InterfaceError if a directory does not exist or cannot be read and written.
        """
        for path in filter(None, (self._options.speak, self._options.listen)):
            if not (os.path.isdir(path) and os.access(path, os.R_OK | os.W_OK | os.X_OK)):
                raise InterfaceError(f"{path}: no directory that can be read and written", f"mkdir -p {path}")
        self._running = _RunningMorse(self._options, self._dev, host)
        host.link(True, f"a dot lasts {self._options.unit_ms} ms")

    def send(self, request: Request) -> Sent:
        """Write the PDU as a WAV file and blink it on the line.

        Raises RequestError if it is longer than morse.MAX_PDU octets.
        """
        return BUSY if self._running is None else self._running.send(request)

    def refresh(self) -> None:
        """Do nothing: neither the kernel nor a device counts anything for this driver."""

    def stop(self) -> None:
        if self._running is not None:
            self._running.stop()
            self._running = None


class _RunningMorse:
    """State between start() and stop(): the open line, and the files that are written or read."""

    def __init__(self, options: MorseOptions, dev: Path, host: Host) -> None:
        self._options = options
        self._host = host
        self._files: set[BinaryIO] = set()
        self._ways = 0  # outputs that have not finished the current message: the file, the line
        self._speak_timer: Timer | None = None
        self._line: OutputLine | None = None
        self._blinker: Blinker | None = None
        if options.line is not None:
            self._line = OutputLine(LineDescription(chip=options.chip, offset=options.line, initial="inactive"), dev)
            self._blinker = Blinker(host.loop, self._line)
        self._look_timer = host.loop.after(0.0, self._look) if options.listen else None

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

    def stop(self) -> None:
        for timer in (self._look_timer, self._speak_timer):
            if timer is not None:
                timer.cancel()
        for file in self._files.copy():
            self._close(file)
        if self._blinker is not None:
            self._blinker.stop()
        if self._line is not None:
            self._line.close()

    def _speak(self, request: Request, slices: Iterator[bytes]) -> None:
        """Open a WAV file; each turn of the loop then writes one slice of it."""
        speak = self._options.speak
        for old in _files(speak)[: 1 - KEEP]:
            os.unlink(old)
        # The file gets its final name when it is complete, so a listening station never reads a partial file.
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
        """Count one output as finished; confirm the request when all are finished."""
        self._ways -= 1
        if not self._ways:
            self._host.confirm(request)
            self._host.writable()

    def _look(self) -> None:
        """Open and remove the oldest WAV file, if there is one, and start to decode it; repeats every POLL_S."""
        try:
            for path in _files(self._options.listen)[:1]:
                file = open(path, "rb")  # noqa: SIM115 closed by its last slice or stop()
                self._files.add(file)
                os.unlink(path)
                self._hear(file, morse.ToneDecoder())
                return
        except OSError as error:
            self._fail(self._options.listen, error)
            return
        self._look_timer = self._host.loop.after(POLL_S, self._look)

    def _hear(self, file: BinaryIO, ear: morse.ToneDecoder, sample: bytes = b"") -> None:
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

    def _heard(self, ear: morse.ToneDecoder, sample: bytes) -> None:
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
