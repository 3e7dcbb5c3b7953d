"""Reader of PDUs and JSON objects from arguments, files, folders and standard input.

It detects the format. An error is an item of the stream, so that the next message is still read.
"""

import codecs
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeAlias

from board.runtime.errors import ProtocolError, RequestError
from firmware import file_remedy
from firmware.client.sending import json_texts
from firmware.client.sending.payload import base64_octets, hex_octets
from firmware.codec import foreign
from firmware.recordings import capture, layers, mcap, reception

FORMS = ("hex", "base64", "binary", "json", "pcap", "mcap")
STANDARD_INPUT = "standard input"

MAX_PDU = 0xFFFF  # octets; a station sends at most 1500, but files may contain longer messages
MAX_LINE = 16 << 20  # octets

# Suffix of a file name. If the file is missing, its name must not be reported as invalid hexadecimal digits.
_SUFFIX = re.compile(r"\.[a-z][a-z0-9]{2,6}$", re.IGNORECASE)
_HEX = re.compile(r"(0x)?[0-9a-fA-F: \t]*")
# protocolVersion is small, so the base64 of an ITS PDU begins with A. Misspelt hexadecimal digits do not match.
_BASE64 = re.compile(r"A(?:[A-Za-z0-9+/]{4})*[A-Za-z0-9+/](?:[A-Za-z0-9+/]{2}|[A-Za-z0-9+/]=|==)")
# Prefix of kept files of a recorder. They sort among the files of its ring, by the time in their names.
_KEPT = re.compile(r"^kept(?=-\d{8}-)")
_OCTET = re.compile(r"[0-9a-fA-F]{2}")
_ACCEPTED = (
    "accepted are hexadecimal digits, base64, JSON objects with `hex` or `base64`, and names of files that hold these, "
    "octets or a capture; or say --format"
)
_TEXT = frozenset(b"\t\r\n") | frozenset(range(0x20, 0x7F))


class Pdu(NamedTuple):
    """A message in its octets.

    origin   its place in the input: "cam.pcap: frame 3".
    port     BTP port; None if unknown.
    when_ns  Unix time of reception in ns; None if unknown.
    carried  names of the layers around it; empty for a bare PDU.
    frame    the whole Ethernet frame; empty without one.
    """

    octets: bytes
    origin: str
    port: int | None = None
    when_ns: int | None = None
    carried: str = ""
    frame: bytes = b""


class Object(NamedTuple):
    """A JSON object, with its place in the input."""

    value: dict[str, object]
    origin: str


Item: TypeAlias = Pdu | Object | RequestError


class Reader:
    """Reads sources one after the other.

    form     one of FORMS for all sources; None: detect it for each.
    skipped  number of frames without a message, by kind.
    """

    def __init__(self, form: str | None, standard_input: BinaryIO) -> None:
        self.skipped: Counter[str] = Counter()
        self._form = form
        self._standard_input = standard_input

    def read(self, sources: Sequence[str]) -> Iterator[Item]:
        """Yield the items of files, folders, `-` for standard input, or a message given as text.

        An empty capture is an error only if it is the only source: a ring may contain some.
        """
        is_any = False
        for item in self._all(sources):
            yield item
            is_any = True
        if not is_any and not self.skipped:
            where = ", ".join(STANDARD_INPUT if source == "-" else source for source in sources)
            yield RequestError(f"{where}: it holds no frame")

    def _all(self, sources: Sequence[str]) -> Iterator[Item]:
        if len(sources) > 1 and all(_OCTET.fullmatch(source) for source in sources):
            # arguments of two digits each are one message, typed with blanks between its octets
            sources = ["".join(sources)]
        for source in sources:
            if source == "-":
                yield from self._stream(self._standard_input, STANDARD_INPUT)
            elif os.path.isdir(source):
                yield from self._folder(Path(source))
            elif _is_file(source, self._form):
                yield from self._file(Path(source))
            else:
                yield from self._argument(source)

    def _argument(self, text: str) -> Iterator[Item]:
        if self._form in ("binary", "pcap", "mcap"):
            yield RequestError(f"an argument cannot be {self._form}", "write it to a file, or to standard input")
        else:
            yield from self._lines([text.encode(errors="surrogateescape")], "the argument", is_one=True)

    def _folder(self, path: Path) -> Iterator[Item]:
        try:
            files = [entry for entry in path.iterdir() if entry.is_file()]
        except OSError as error:
            yield RequestError(f"{path}: {error.strerror}", file_remedy.to_read(error))
            return
        if not files:
            yield RequestError(f"{path}: it holds no file")
        for file in sorted(files, key=lambda file: (_KEPT.sub("ring", file.name), file.name)):
            yield from self._file(file)

    def _file(self, path: Path) -> Iterator[Item]:
        try:
            with path.open("rb") as stream:
                yield from self._stream(stream, str(path))
        except OSError as error:
            yield RequestError(f"{path}: {error.strerror}", file_remedy.to_read(error))

    def _stream(self, stream: BinaryIO, where: str) -> Iterator[Item]:
        """Yield the items of a stream. Octets that are not text are a capture or one PDU."""
        form, head = self._form, stream.read(4)
        if head.startswith(codecs.BOM_UTF8):  # byte order mark of Windows editors
            head = head[len(codecs.BOM_UTF8) :] + stream.read(len(codecs.BOM_UTF8))
        if form is None and capture.is_capture(head):
            form = "pcap"
        elif form is None and head == mcap.HEAD:
            form = "mcap"
        elif form is None and not _TEXT.issuperset(head):
            form = "binary"
        if form == "pcap":
            yield from self._capture(head, stream, where)
        elif form == "mcap":
            yield from self._recording(head, stream, where)
        elif form == "binary":
            yield _bounded(head + stream.read(MAX_PDU + 1 - len(head)), where)
        else:
            yield from self._lines(_lines(head, stream), where)

    def _capture(self, head: bytes, stream: BinaryIO, where: str) -> Iterator[Item]:
        try:
            for frame in capture.frames(head, stream):
                yield from self.frame(frame, f"{where}: frame {frame.number}")
        except ProtocolError as error:
            yield RequestError(f"{where}: {error.message}")

    def _recording(self, head: bytes, stream: BinaryIO, where: str) -> Iterator[Item]:
        try:
            for one in reception.receptions(head, stream, self.skipped):
                yield Pdu(one.pdu, f"{where}: message {one.number}", one.port or None, one.when_ns)
        except ProtocolError as error:
            yield RequestError(f"{where}: {error.message}")

    def frame(self, frame: capture.Frame, origin: str) -> Iterator[Item]:
        """Yield the message of a frame of a capture, if it has one."""
        try:
            found = layers.open_frame(frame.link, frame.octets)
        except ProtocolError as error:
            cut = f" ({frame.missing} octets of it were not captured)" if frame.missing else ""
            yield RequestError(f"{origin}: {error.message}{cut}")
            return
        if isinstance(found, layers.NoMessage):
            self.skipped[found.what] += 1
            return
        whole = frame.octets if frame.link == capture.ETHERNET else b""
        when = frame.when_ns or None  # captures without time have time 0
        yield Pdu(found.pdu, origin, found.btp_port, when, str(found), whole)

    def _lines(self, lines: Iterable[bytes], where: str, is_one: bool = False) -> Iterator[Item]:
        """Yield the items of text lines. The lines of one JSON object belong together."""
        count = 0
        texts = json_texts.split(_decoded(lines))
        for begin, text in texts:
            origin = where if is_one else f"{where}: line {begin}"
            xml = foreign.xml(text, (line.text for line in texts)) if self._form in (None, "json") else None
            for item in [RequestError(f"{origin}: {xml.why}")] if xml else self._text(text, origin):
                count += 1
                yield item
            if xml and not xml.is_whole:
                return
        if not count:
            yield RequestError(f"{where}: it holds no message")

    def _text(self, text: str, origin: str) -> Iterator[Item]:
        try:
            if self._form == "json" or (self._form is None and text.lstrip().startswith(("{", "["))):
                yield from _objects(text, origin)
                return
            for line in text.splitlines():
                if bare := line.partition("#")[0].strip():
                    yield self._octets(bare, origin)
        except RequestError as error:
            yield error

    def _octets(self, text: str, origin: str) -> Pdu:
        is_base64 = not _HEX.fullmatch(text) and _BASE64.fullmatch(text) is not None
        if self._form == "base64" or (self._form is None and is_base64):
            return opened(base64_octets(text, origin), origin)
        return opened(hex_octets(text, origin, _ACCEPTED), origin)


def opened(octets: bytes, origin: str) -> Pdu:
    """Return a PDU; for a whole frame with GeoNetworking, the PDU inside.

    Raises RequestError for a frame without an ITS message, and for a malformed frame.
    """
    link = layers.link_of(octets)
    if link is None:
        return Pdu(octets, origin)
    try:
        found = layers.open_frame(link, octets)
    except ProtocolError as error:
        raise RequestError(f"{origin}: {error.message}") from error
    if isinstance(found, layers.NoMessage):
        raise RequestError(f"{origin}: {layers.NAMES[link]} frame without an ITS message: {found.what}")
    return Pdu(found.pdu, origin, found.btp_port, None, str(found), octets if link == capture.ETHERNET else b"")


def pdu_of(one: Pdu | Object) -> Pdu:
    """Return the PDU of an item; of a JSON object its `hex` or `base64`, as of `captain listen --json`.

    Raises RequestError if an object has neither.
    """
    if isinstance(one, Pdu):
        return one
    for key in ("hex", "base64"):
        text, where = one.value.get(key), f"{one.origin}: {key}"
        if isinstance(text, str):
            octets = base64_octets(text, where) if key == "base64" else hex_octets(text, where, "")
            pdu = opened(octets, one.origin)
            return pdu._replace(port=port_of(one) if pdu.port is None else pdu.port, when_ns=when_ns(one))
    raise RequestError(f"{one.origin}: `message`, `hex` or `base64` is missing")


def when_ns(one: Object) -> int | None:
    """Return the Unix time in ns from the key `received`, which is in seconds."""
    received = one.value.get("received")
    if isinstance(received, bool) or not isinstance(received, int | float) or not 0 <= received < 2**32:
        return None
    return round(received * 1e6) * 1000


def port_of(one: Object) -> int | None:
    """Return the BTP port from the key `btp_port`."""
    port = one.value.get("btp_port")
    return port if isinstance(port, int) and not isinstance(port, bool) and 0 <= port <= 0xFFFF else None


def _objects(text: str, origin: str) -> Iterator[Item]:
    value = json_texts.parse(text, origin)
    items = value if isinstance(value, list) else [value]
    for at, item in enumerate(items):
        where = f"{origin}: item {at}" if isinstance(value, list) else origin
        if isinstance(item, dict):
            yield Object(item, where)
        else:
            yield RequestError(f"{where}: {str(item)[:40]!r} is not an object")


def _is_file(source: str, form: str | None) -> bool:
    if source.startswith(("{", "[", "<")):
        return False
    try:
        if os.path.exists(source):
            return True
    except ValueError:  # a NUL in the path
        return False
    could_be_base64 = form == "base64" or (form is None and _BASE64.fullmatch(source) is not None)
    return not could_be_base64 and ("/" in source or _SUFFIX.search(source) is not None)


def _bounded(octets: bytes, where: str) -> Item:
    if not octets:
        return RequestError(f"{where}: it holds no message")
    if len(octets) > MAX_PDU:
        return RequestError(f"{where}: more than {MAX_PDU} octets: too long for a PDU")
    try:
        return opened(octets, where)
    except RequestError as error:
        return error


def _lines(head: bytes, stream: BinaryIO) -> Iterator[bytes]:
    """Yield the lines of a stream whose first octets were already read."""
    if not head.endswith(b"\n"):
        head += stream.readline(MAX_LINE)
    yield from head.splitlines(keepends=True)
    while line := stream.readline(MAX_LINE):
        yield line


def _decoded(lines: Iterable[bytes]) -> Iterator[str]:
    """Decode lines. Invalid UTF-8 becomes escapes, which the hexadecimal reader then refuses with their place."""
    for line in lines:
        yield line.decode(errors="backslashreplace")
