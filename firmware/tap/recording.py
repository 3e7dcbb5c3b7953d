"""Messages into files: JSON lines or pcap, a new file after so many messages or octets."""

import contextlib
import json
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import BinaryIO, NamedTuple

from board import state_file
from board.errors import RequestError, StationError
from firmware.tap.counts import Taken

SUFFIXES = {".jsonl": "json", ".json": "json", ".pcap": "pcap", ".cap": "pcap"}
MOST_FILES = 10**6  # of a name
SETTLE_S = 0.5  # a cut of the power takes a second of messages at most; each wait for the card wears it


class Rotation(NamedTuple):
    """When another file is begun: before one would have more octets or messages; None: never.

    keep  so many of the files that were written here, the oldest goes; None: all.
    """

    octets: int | None = None
    messages: int | None = None
    keep: int | None = None

    @property
    def is_wanted(self) -> bool:
        return self.octets is not None or self.messages is not None


class Recording:
    """Files of one name; never one that is there already. Every message is with the kernel before the next one.

    path      of the file; with a rotation a number stands before the suffix: drive.000001.jsonl.
    clock     monotonic seconds.

    Raises RequestError for a name of no known kind, StationError where a file cannot be written.
    """

    def __init__(self, path: Path, rotation: Rotation, clock: Callable[[], float] = time.monotonic) -> None:
        form = SUFFIXES.get(path.suffix.lower())
        if form is None:
            raise RequestError(f"{path}: {path.suffix or 'a name without a suffix'} is no form of recordings", _FORMS)
        self.messages = 0
        self.files = 0
        self._form = form
        self._path = path
        self._rotation = rotation
        self._clock = clock
        self._waits_since: float | None = None
        self._is_new = True  # its name is not on the card yet
        self._names = _numbered(path) if rotation.is_wanted else iter([path])
        self._kept: deque[Path] = deque()
        self._open()

    def write(self, message: Taken) -> None:
        """Add a message. Raises RequestError where pcap has no frame for it, StationError where the file takes none."""
        octets = _json(message) if self._form == "json" else _frame(message)
        octets_most, messages_most, _ = self._rotation
        is_long = octets_most is not None and self._inside and self._octets + len(octets) > octets_most
        if is_long or self._inside == messages_most:
            self.close()
            self._open()
        self._put(octets)
        self._inside += 1
        self.messages += 1
        self.idle()

    def idle(self) -> None:
        """Wait for the card where something has waited for SETTLE_S. To be called some times a second."""
        if self._waits_since is not None and self._clock() - self._waits_since >= SETTLE_S:
            self.settle()

    def settle(self) -> None:
        """All that was written outlives a cut of the power once this returns. Raises StationError."""
        self._waits_since = None
        try:
            os.fsync(self._file.fileno())
            if self._is_new:
                state_file.settle(Path(self._file.name).parent)
                self._is_new = False
        except OSError as error:
            raise self._failed(error) from error

    def close(self) -> None:
        """Of a file that is closed all is kept, where the card takes it."""
        if self._waits_since is not None:
            with contextlib.suppress(StationError):  # it was told when it was written, or will be by the next file
                self.settle()
        self._file.close()

    def _open(self) -> None:
        self._file = self._create()
        self._is_new = True
        self.files += 1
        self._inside = self._octets = 0
        if self._form == "pcap":
            from firmware.codec import capture

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
                    continue  # another copy has it, or an earlier one
        except OSError as error:
            raise StationError(f"{self._path}: {error.strerror}") from error
        raise StationError(f"{self._path} is there already", "name another file, or let --max-messages number them")

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
        return StationError(f"{self._file.name}: {error.strerror}; {self.messages} messages are recorded")


_FORMS = f"take one of {', '.join(SUFFIXES)}"


def _numbered(path: Path) -> Iterator[Path]:
    numbers = count(1)
    while (number := next(numbers)) < MOST_FILES:
        yield path.with_name(f"{path.stem}.{number:06}{path.suffix}")


def _json(message: Taken) -> bytes:
    return json.dumps(message.record()).encode() + b"\n"


def _frame(message: Taken) -> bytes:
    from firmware.codec import capture
    from firmware.codec.reading import Pdu
    from firmware.codec.writing import framed

    return capture.record(framed(Pdu(message.pdu, message.topic, message.btp_port)), message.received_ns)
