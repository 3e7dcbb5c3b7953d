"""Where a recording goes: one file, a pipe, or a ring with what makes it keep something."""

import select
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, BinaryIO, Protocol

from board.errors import RequestError, UsageError
from firmware.recorder.filing import Filing, Segment
from firmware.recorder.ring import Limits, Ring
from firmware.recorder.scribe import Scribe
from firmware.recorder.shares import OWN, operators
from firmware.recorder.told import Told
from firmware.recorder.triggers import DENM, Triggers


class Sink(Protocol):
    """scribe counts what was written; know() begins it, or begins it anew; idle() is called a few times a second."""

    scribe: Scribe

    def know(self, status: Mapping[str, object]) -> None: ...
    def time(self, status: Mapping[str, object]) -> None: ...
    def add(self, told: Told) -> None: ...
    def idle(self) -> None: ...
    def close(self) -> None: ...


class File:
    """One file, which must not exist. Raises UsageError or RequestError where it cannot be begun."""

    def __init__(self, path: Path) -> None:
        self.scribe = Scribe()
        self._path = path
        try:
            path.open("xb").close()
        except FileExistsError:
            raise UsageError(f"--pcapng: {path} is there already", "name another, or remove it") from None
        except OSError as error:
            raise RequestError(
                f"{path}: {error.strerror}", "does its folder exist, and may you write there?"
            ) from error
        self._filing = Filing(self.scribe, lambda: Segment(path))

    def know(self, status: Mapping[str, object]) -> None:
        self.scribe.know(status)
        self.idle()

    def time(self, status: Mapping[str, object]) -> None: ...

    def add(self, told: Told) -> None:
        self._filing.add(told)

    def idle(self) -> None:
        self._filing.idle()

    def close(self) -> None:
        """Where no station was there no file is left."""
        self._filing.end()
        with suppress(OSError):
            if not self._path.stat().st_size:
                self._path.unlink()


class Pipe:
    """A stream that somebody reads while it is written; BrokenPipeError is raised when nobody does any more."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.scribe = Scribe()
        self._stream = stream
        self._end = select.poll()
        self._end.register(stream, 0)  # POLLERR is always told: the reader has left
        self._is_begun = False

    def write(self, octets: bytes) -> None:
        self._stream.write(octets)

    def know(self, status: Mapping[str, object]) -> None:
        self.scribe.know(status)
        self.idle()

    def time(self, status: Mapping[str, object]) -> None: ...

    def add(self, told: Told) -> None:
        self._begin()
        self.scribe.add(told)

    def idle(self) -> None:
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
    """Standard output, for octets. Raises UsageError where it is a terminal, or was closed and is /dev/null by now."""
    if sys.__stdout__ is None:
        raise UsageError("standard output is closed: nobody would get the recording", remedy)
    if sys.stdout.isatty():
        raise UsageError("a terminal cannot show a recording", remedy)
    return sys.stdout.buffer


class Keeper:
    """A ring, kept of when something triggers."""

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

    def know(self, status: Mapping[str, object]) -> None:
        self.scribe.know(status)
        self.ring.idle()

    def time(self, status: Mapping[str, object]) -> None:
        if why := self._triggers.time(status):
            self.ring.trigger(why)

    def add(self, told: Told) -> None:
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
        """As an operator asks."""
        self.ring.trigger(operators(why))

    def close(self) -> None:
        self.ring.close()
