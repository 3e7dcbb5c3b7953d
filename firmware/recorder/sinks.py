"""Sinks of a recording: one file, a pipe, or a ring with triggers."""

import select
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, BinaryIO, Protocol

from board.runtime.errors import RequestError, UsageError
from firmware import file_remedy
from firmware.recorder.filing import Filing, Segment
from firmware.recorder.reported_frame import ReportedFrame
from firmware.recorder.ring import Limits, Ring
from firmware.recorder.scribe import Scribe
from firmware.recorder.shares import OWN, operators
from firmware.recorder.triggers import DENM, Triggers


class Sink(Protocol):
    """Receiver of a station's frames.

    take_status() begins a recording, or a new section after a restart. The caller calls idle() a few times a second.
    scribe has the counts of written and lost frames.
    """

    scribe: Scribe

    def take_status(self, status: Mapping[str, object]) -> None: ...
    def time(self, status: Mapping[str, object]) -> None: ...
    def add(self, told: ReportedFrame) -> None: ...
    def idle(self) -> None: ...
    def close(self) -> None: ...


class File:
    """Sink that writes one new file. Raises UsageError if the file exists, RequestError if it cannot be written."""

    def __init__(self, path: Path) -> None:
        self.scribe = Scribe()
        self._path = path
        try:
            path.open("xb").close()
        except FileExistsError:
            raise UsageError(f"--pcapng: {path}: the file exists", "name another file, or remove it") from None
        except OSError as error:
            raise RequestError(f"--pcapng: {path}: {error.strerror}", file_remedy.to_write(error)) from error
        self._filing = Filing(self.scribe, lambda: Segment(path))

    def take_status(self, status: Mapping[str, object]) -> None:
        self.scribe.take_status(status)
        self.idle()

    def time(self, status: Mapping[str, object]) -> None: ...

    def add(self, told: ReportedFrame) -> None:
        self._filing.add(told)

    def idle(self) -> None:
        self._filing.idle()

    def close(self) -> None:
        """Complete the file, or remove it if it is empty because no station was heard."""
        self._filing.end()
        with suppress(OSError):
            if not self._path.stat().st_size:
                self._path.unlink()


class Pipe:
    """Sink that writes a stream to another program. Raises BrokenPipeError once the reader has closed it."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.scribe = Scribe()
        self._stream = stream
        self._end = select.poll()
        self._end.register(stream, 0)  # poll() always reports POLLERR, which means that the reader has closed the pipe
        self._is_begun = False

    def write(self, octets: bytes) -> None:
        self._stream.write(octets)

    def take_status(self, status: Mapping[str, object]) -> None:
        self.scribe.take_status(status)
        self.idle()

    def time(self, status: Mapping[str, object]) -> None: ...

    def add(self, told: ReportedFrame) -> None:
        self._begin()
        self.scribe.add(told)

    def idle(self) -> None:
        """Flush the stream. Raises BrokenPipeError if the reader has closed it, even if there is nothing to write."""
        self._begin()
        self._stream.flush()
        if any(events & select.POLLERR for _, events in self._end.poll(0)):
            raise BrokenPipeError

    def close(self) -> None:
        self.scribe.end()
        self._stream.flush()

    def _begin(self) -> None:
        if not self._is_begun:
            self._is_begun = True
            self.scribe.begin(self)


def standard_output() -> Pipe:
    return Pipe(output("send it through a pipe: ... --pcapng - | tshark -r -"))


def output(remedy: str) -> BinaryIO:
    """Return standard output as a binary stream. Raises UsageError if it is a terminal or closed."""
    if sys.__stdout__ is None:
        raise UsageError("standard output: closed", remedy)
    if sys.stdout.isatty():
        raise UsageError("standard output: a terminal cannot show a recording", remedy)
    return sys.stdout.buffer


class Keeper:
    """Sink that writes a ring, and keeps files when an event triggers."""

    def __init__(
        self,
        folder: Path,
        limits: Limits,
        triggers: frozenset[str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.scribe = Scribe()
        self.ring = Ring(folder, limits, self.scribe, clock)
        self._triggers = Triggers(triggers)
        self._clock = clock

    def take_status(self, status: Mapping[str, object]) -> None:
        self.scribe.take_status(status)
        self.ring.idle()

    def time(self, status: Mapping[str, object]) -> None:
        if why := self._triggers.time(status):
            self.ring.trigger(why)

    def add(self, told: ReportedFrame) -> None:
        missing = self.scribe.missing
        self.ring.add(told)
        why = self._triggers.frame(told, self.scribe.missing - missing, self._clock())
        if why == DENM:
            self.ring.trigger(f"{why}-{OWN if told.is_out else told.said.get('station_id')}")
        elif why:
            self.ring.trigger(why)

    def idle(self) -> None:
        self.scribe.settle()
        self.ring.idle()

    def trigger(self, why: str) -> None:
        """Keep files for a reason given by an operator."""
        self.ring.trigger(operators(why))

    def close(self) -> None:
        self.ring.close()
