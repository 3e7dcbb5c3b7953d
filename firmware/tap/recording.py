"""Messages into files: JSON lines or pcap, a new file after so many messages or octets."""

import json
from collections import deque
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import BinaryIO, NamedTuple

from board.errors import RequestError, StationError
from firmware.tap.counts import Taken

SUFFIXES = {".jsonl": "json", ".json": "json", ".pcap": "pcap", ".cap": "pcap"}
MOST_FILES = 10**6  # of a name


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

    Raises RequestError for a name of no known kind, StationError where a file cannot be written.
    """

    def __init__(self, path: Path, rotation: Rotation) -> None:
        form = SUFFIXES.get(path.suffix.lower())
        if form is None:
            raise RequestError(f"{path}: {path.suffix or 'a name without a suffix'} is no form of recordings", _FORMS)
        self.messages = 0
        self.files = 0
        self._form = form
        self._path = path
        self._rotation = rotation
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

    def close(self) -> None:
        self._file.close()

    def _open(self) -> None:
        self._file = self._create()
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
            raise StationError(f"{self._file.name}: {error.strerror}; {self.messages} messages are recorded") from error
        self._octets += len(octets)


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
