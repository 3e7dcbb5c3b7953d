"""Writers of messages: hexadecimal, base64, binary, JSON, pcap."""

import argparse
import base64
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Protocol

from board.runtime.errors import RequestError, StationError
from drivers.message import Ego, Position, Request
from drivers.wire import frame
from drivers.wire.geonet.sender import Sender
from firmware.client.sending import payload
from firmware.codec.decoding import Decoder, record
from firmware.codec.foreign import message_frame
from firmware.codec.library import NoLibraryError, load
from firmware.codec.reading import Pdu
from firmware.recordings import capture
from firmware.topics import Topics

FORMS = (*payload.FORMATS, "pcap")
SUFFIXES = {**payload.SUFFIXES, ".pcap": "pcap", ".cap": "pcap"}

_NOWHERE = Ego(its_ms=0, position=Position(), is_known=False)
_TYPES = Topics()


class Writer(Protocol):
    def write(self, pdu: Pdu) -> None:
        """Add a message. Raises RequestError if the format cannot hold it."""


class Output:
    """Output of messages. The file is opened for the first message, so that no empty file remains."""

    def __init__(self, form: str, path: str | None, edition: str | None, is_forced: bool = False) -> None:
        self._form = form
        self._path = path
        self._edition = edition
        self._is_forced = is_forced
        self._stream: BinaryIO | None = None
        self._writer: Writer | None = None

    @property
    def keeps_octets(self) -> bool:
        """True if octets are written unchanged, even undecodable ones."""
        return self._form not in ("json", "pcap")

    def write(self, pdu: Pdu) -> None:
        """Write a message; the first opens the file.

        Raises StationError if it cannot be opened, and for binary on a terminal.
        """
        if self._writer is None:
            self._writer = self._open()
        self._writer.write(pdu)
        if self._path is None and self._stream is not None:
            self._stream.flush()  # the reader of a pipe must receive it at once

    def close(self) -> None:
        if self._path is not None and self._stream is not None:
            self._stream.close()

    def _open(self) -> Writer:
        if self._path is None:
            if self._form in ("binary", "pcap") and sys.stdout.isatty():
                raise StationError(f"a terminal cannot show {self._form}", "write it to a file: -o FILE")
            self._stream = sys.stdout.buffer
        elif self._stream is None:
            try:
                self._stream = Path(self._path).open("wb")  # noqa: SIM115 closed by close()
            except OSError as error:
                raise StationError(f"{self._path}: {error.strerror}") from error
        return self._kind(self._stream)

    def _kind(self, stream: BinaryIO) -> Writer:
        match self._form:
            case "json":
                return Json(stream, Decoder(load(), self._edition, self._is_forced))
            case "pcap":
                return Pcap(stream)
            case "binary":
                return Binary(stream)
            case "base64":
                return Base64(stream)
            case _:
                return Hex(stream)


class Hex:
    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def write(self, pdu: Pdu) -> None:
        self._stream.write(pdu.octets.hex().encode() + b"\n")


class Base64:
    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def write(self, pdu: Pdu) -> None:
        self._stream.write(base64.b64encode(pdu.octets) + b"\n")


class Binary:
    """Writer of a single message as octets. A second one is refused, because a reader could not separate them."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._is_full = False

    def write(self, pdu: Pdu) -> None:
        """Write a message. Raises RequestError for a second one."""
        if self._is_full:
            raise RequestError(f"{pdu.origin}: binary holds one message only", "take --to hex, base64 or pcap")
        self._is_full = True
        self._stream.write(pdu.octets)


class Json:
    """Writer of decoded messages, one per line. Undecodable octets are refused."""

    def __init__(self, stream: BinaryIO, decoder: Decoder) -> None:
        self._stream = stream
        self._decoder = decoder

    def write(self, pdu: Pdu) -> None:
        self._stream.write(record(pdu, self._decoder.identify(pdu)).encode() + b"\n")


class Pcap:
    """Writer of Ethernet frames: the original ones, or single-hop broadcasts of a station without a position.

    Frames without a time have time 0, so that the same messages give the same file.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._stream.write(capture.header())

    def write(self, pdu: Pdu) -> None:
        self._stream.write(capture.record(pdu.frame or framed(pdu), pdu.when_ns or 0))


def framed(pdu: Pdu) -> bytes:
    """Return an Ethernet frame for a bare PDU. Raises RequestError without a BTP port.

    Its MAC address ends in the stationID.
    """
    if (other := message_frame(pdu.octets)) is not None and pdu.port is None:
        raise RequestError(f"{pdu.origin}: {other}")
    kind = _TYPES.by_number[pdu.octets[1]] if len(pdu.octets) > 1 else _TYPES.unknown
    port = kind.btp_port if pdu.port is None else pdu.port
    port = _port_by_library(pdu) if port is None else port
    if port is None:
        raise RequestError(f"{pdu.origin}: no BTP port is known for it", "give it as JSON with `btp_port`, or send it")
    mac = b"\x02\x00" + pdu.octets[2:6].ljust(4, b"\0")
    request = Request(0, kind, pdu.octets, port, 0.0, 0.0, kind.priority, kind.traffic_class)
    return frame.wrap(mac, Sender(mac).encode(request, 0.0, _NOWHERE))


def _port_by_library(pdu: Pdu) -> int | None:
    """Return the BTP port of an experimental message; None if the library lacks it or is not installed."""
    try:
        return Decoder(load()).identify(pdu, is_quick=True).message.btp_port or None
    except (NoLibraryError, RequestError):
        return None


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add the options --to and -o, which output() reads."""
    parser.add_argument("--to", choices=FORMS, help="format to write (default: by the name of FILE)")
    parser.add_argument("-o", "--output", metavar="FILE", help="file to write (default: standard output)")


@contextmanager
def output(arguments: argparse.Namespace, default: str) -> Iterator[Output]:
    """Open the output that --to and -o specify, and close it at the end.

    Raises RequestError for a file name with an unknown suffix, without --to.
    """
    suffix = Path(arguments.output).suffix.lower() if arguments.output else ""
    form = arguments.to or SUFFIXES.get(suffix)
    if form is None and suffix:
        raise RequestError(
            f"{arguments.output}: {suffix}: unknown output format", f"say --to, or take {', '.join(SUFFIXES)}"
        )
    out = Output(form or default, arguments.output, arguments.edition, arguments.force)
    try:
        yield out
    finally:
        out.close()
