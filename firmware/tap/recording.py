"""Recording of a tap: JSON lines or pcap, in files of limited size."""

import contextlib
import json
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import BinaryIO, NamedTuple

from board.runtime import state_file
from board.runtime.errors import RequestError, StationError
from firmware import file_remedy
from firmware.tap.counts import Taken

SUFFIXES = {".jsonl": "json", ".json": "json", ".pcap": "pcap", ".cap": "pcap"}
MOST_FILES = 10**6  # files with one name
# Seconds between syncs: a power failure loses at most a second of messages, but each sync wears the card.
SETTLE_S = 0.5


class Rotation(NamedTuple):
    """Limits at which another file is begun; None: no limit.

    octets    octets of a file.
    messages  messages of a file.
    keep      number of files of this run to keep, the oldest is removed; None: all.
    """

    octets: int | None = None
    messages: int | None = None
    keep: int | None = None

    @property
    def is_wanted(self) -> bool:
        return self.octets is not None or self.messages is not None


class Recording:
    """Recording to new files with one name; existing files are never overwritten.

    Each message is written to the kernel at once.

    path      path of the file; with a rotation, a number is put before the suffix: drive.000001.jsonl.
    clock     monotonic time in seconds.

    Raises RequestError for an unknown suffix, StationError if a file cannot be created or written.
    """

    def __init__(self, path: Path, rotation: Rotation, clock: Callable[[], float] = time.monotonic) -> None:
        form = SUFFIXES.get(path.suffix.lower())
        if form is None:
            raise RequestError(f"{path}: unknown format: {path.suffix or 'no suffix'}", _FORMS)
        self.messages = 0
        self.files = 0
        self._form = form
        self._path = path
        self._rotation = rotation
        self._clock = clock
        self._waits_since: float | None = None
        self._is_new = True  # the file's name is not synced to the card yet
        self._names = _numbered(path) if rotation.is_wanted else iter([path])
        self._kept: deque[Path] = deque()
        self._inside = self._octets = 0  # messages and octets of the current file
        self._file = self._create()
        self._begin()

    def write(self, message: Taken) -> None:
        """Add a message.

        Raises RequestError if pcap has no frame for it, StationError if the file cannot be written.
        """
        octets = _json(message) if self._form == "json" else _frame(message)
        octets_most, messages_most, _ = self._rotation
        is_long = octets_most is not None and self._inside and self._octets + len(octets) > octets_most
        if is_long or self._inside == messages_most:
            self.close()
            self._file = self._create()
            self._begin()
        self._put(octets)
        self._inside += 1
        self.messages += 1
        self.idle()

    def idle(self) -> None:
        """Sync to the card if data has waited for SETTLE_S. The caller calls it a few times a second."""
        if self._waits_since is not None and self._clock() - self._waits_since >= SETTLE_S:
            self.settle()

    def settle(self) -> None:
        """Sync: all written messages survive a power failure once this returns.

        Raises StationError if the card refuses.
        """
        self._waits_since = None
        try:
            os.fsync(self._file.fileno())
            if self._is_new:
                state_file.settle(Path(self._file.name).parent)
                self._is_new = False
        except OSError as error:
            raise self._failed(error) from error

    def close(self) -> None:
        """Sync and close the file."""
        if self._waits_since is not None:
            with contextlib.suppress(StationError):  # write() has reported this error, or the next file will
                self.settle()
        self._file.close()

    def _begin(self) -> None:
        self._is_new = True
        self.files += 1
        self._inside = self._octets = 0
        if self._form == "pcap":
            from firmware.recordings import capture

            self._put(capture.header())
        if len(self._kept) == self._rotation.keep:
            self._kept.popleft().unlink(missing_ok=True)
        self._kept.append(Path(self._file.name))

    def _create(self) -> BinaryIO:
        try:
            for path in self._names:
                try:
                    return path.open("xb")
                except FileExistsError:
                    continue  # an earlier run or another copy of the tap has created it
        except OSError as error:
            raise StationError(f"--record: {self._path}: {error.strerror}", file_remedy.to_write(error)) from error
        raise StationError(f"--record: {self._path}: the file exists", "name another, or add --max-messages")

    def _put(self, octets: bytes) -> None:
        try:
            self._file.write(octets)
            self._file.flush()
        except OSError as error:
            raise self._failed(error) from error
        self._octets += len(octets)
        if self._waits_since is None:
            self._waits_since = self._clock()

    def _failed(self, error: OSError) -> StationError:
        what = f"{self._file.name}: {error.strerror}; {self.messages} messages are recorded"
        return StationError(what, file_remedy.to_write(error))


_FORMS = f"use one of {', '.join(SUFFIXES)}"


def _numbered(path: Path) -> Iterator[Path]:
    numbers = count(1)
    while (number := next(numbers)) < MOST_FILES:
        yield path.with_name(f"{path.stem}.{number:06}{path.suffix}")


def _json(message: Taken) -> bytes:
    return json.dumps(message.record()).encode() + b"\n"


def _frame(message: Taken) -> bytes:
    from firmware.codec.reading import Pdu
    from firmware.codec.writing import framed
    from firmware.recordings import capture

    return capture.record(framed(Pdu(message.pdu, message.topic, message.btp_port)), message.received_ns)
