"""PDUs and JSON objects from a user's arguments, files, folders and standard input, whatever form they are in.

What is wrong is one item of the stream like the rest, so that the next one is still read.
"""

import codecs
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeAlias

from board.errors import ProtocolError, RequestError
from firmware.codec import capture, foreign, layers, mcap
from firmware.user import json_texts
from firmware.user.payload import base64_octets, hex_octets

FORMS = ("hex", "base64", "binary", "json", "pcap", "mcap")
STANDARD_INPUT = "standard input"

MAX_PDU = 0xFFFF  # octets; a station sends at most 1500, a file may hold what was never sent
MAX_LINE = 16 << 20  # octets

# What a name without its file would have: it shall not be complained about as hexadecimal.
_SUFFIX = re.compile(r"\.[a-z][a-z0-9]{2,6}$", re.IGNORECASE)
_HEX = re.compile(r"(0x)?[0-9a-fA-F: \t]*")
# protocolVersion is small, so that the base64 of an ITS PDU begins with A; a slip in hexadecimal digits does not.
_BASE64 = re.compile(r"A(?:[A-Za-z0-9+/]{4})*[A-Za-z0-9+/](?:[A-Za-z0-9+/]{2}|[A-Za-z0-9+/]=|==)")
# A recorder gives files of its ring another name to keep them; the number behind it says when they were written.
_KEPT = re.compile(r"^kept(?=-\d{8}-)")
_OCTET = re.compile(r"[0-9a-fA-F]{2}")
_ACCEPTED = (
    "accepted are hexadecimal digits, base64, JSON objects with `hex` or `base64`, and names of files that hold these, "
    "octets or a capture; or say --from"
)
_TEXT = frozenset(b"\t\r\n") | frozenset(range(0x20, 0x7F))


class Pdu(NamedTuple):
    """A message in its octets.

    origin   where it stood: "cam.pcap: frame 3".
    port     BTP port that it came by; None where it is not known.
    when_ns  Unix time; None where it is not known.
    carried  by which layers; empty for a bare PDU.
    frame    the whole Ethernet frame; empty where it came in none.
    """

    octets: bytes
    origin: str
    port: int | None = None
    when_ns: int | None = None
    carried: str = ""
    frame: bytes = b""


class Object(NamedTuple):
    """A JSON object."""

    value: dict[str, object]
    origin: str


Item: TypeAlias = Pdu | Object | RequestError


class Reader:
    """Reads sources one after the other.

    form     one of FORMS for all of them; None: each as it looks.
    skipped  what captures held beside messages: frames by what they are.
    """

    def __init__(self, form: str | None, standard_input: BinaryIO) -> None:
        self.skipped: Counter[str] = Counter()
        self._form = form
        self._standard_input = standard_input

    def read(self, sources: Sequence[str]) -> Iterator[Item]:
        """The items of files, folders, `-` for standard input, or text that is none of these.

        A capture without a frame is told where nothing else is read: a ring has such beside others.
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
            sources = ["".join(sources)]  # one message, its octets parted by blanks
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
            yield RequestError(f"{path}: {error.strerror}")
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
            yield RequestError(f"{path}: {error.strerror}")

    def _stream(self, stream: BinaryIO, where: str) -> Iterator[Item]:
        """Octets that are no text are a capture or one PDU."""
        form, head = self._form, stream.read(4)
        if head.startswith(codecs.BOM_UTF8):  # of Windows' editors
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
            for one in mcap.messages(head, stream, self.skipped):
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
        when = frame.when_ns or None  # 1970 is what is written where no time is known
        yield Pdu(found.pdu, origin, found.btp_port, when, str(found), whole)

    def _lines(self, lines: Iterable[bytes], where: str, is_one: bool = False) -> Iterator[Item]:
        """Lines of text; those of an object in JSON belong together."""
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
    """A PDU; of a whole frame with GeoNetworking, what it carries. Raises RequestError."""
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
    """The octets, of an object its `hex` or `base64`: `captain listen --json` prints such. Raises RequestError."""
    if isinstance(one, Pdu):
        return one
    for key in ("hex", "base64"):
        text, where = one.value.get(key), f"{one.origin}: {key}"
        if isinstance(text, str):
            octets = base64_octets(text, where) if key == "base64" else hex_octets(text, where, "")
            pdu = opened(octets, one.origin)
            return pdu._replace(port=port_of(one) if pdu.port is None else pdu.port, when_ns=when_ns(one))
    remedy = "`captain encode` makes octets of a decoded message" if "message" in one.value else ""
    raise RequestError(f"{one.origin}: `hex` or `base64` is missing", remedy)


def when_ns(one: Object) -> int | None:
    """Unix time from the key `received`, in seconds there."""
    received = one.value.get("received")
    if isinstance(received, bool) or not isinstance(received, int | float) or not 0 <= received < 2**32:
        return None
    return round(received * 1e6) * 1000


def port_of(one: Object) -> int | None:
    """BTP port from the key `btp_port`."""
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
            yield RequestError(f"{where}: {str(item)[:40]!r} is no object")


def _is_file(source: str, form: str | None) -> bool:
    if source.startswith(("{", "[", "<")):
        return False
    try:
        if os.path.exists(source):
            return True
    except ValueError:  # a 0 in it
        return False
    could_be_base64 = form == "base64" or (form is None and _BASE64.fullmatch(source) is not None)
    return not could_be_base64 and ("/" in source or _SUFFIX.search(source) is not None)


def _bounded(octets: bytes, where: str) -> Item:
    if not octets:
        return RequestError(f"{where}: it holds no message")
    if len(octets) > MAX_PDU:
        return RequestError(f"{where}: more than {MAX_PDU} octets are no PDU")
    try:
        return opened(octets, where)
    except RequestError as error:
        return error


def _lines(head: bytes, stream: BinaryIO) -> Iterator[bytes]:
    """The lines of a stream whose first octets were read already."""
    if not head.endswith(b"\n"):
        head += stream.readline(MAX_LINE)
    yield from head.splitlines(keepends=True)
    while line := stream.readline(MAX_LINE):
        yield line


def _decoded(lines: Iterable[bytes]) -> Iterator[str]:
    """Decode lines; invalid UTF-8 becomes escapes, which the reader of hexadecimal refuses with their place."""
    for line in lines:
        yield line.decode(errors="backslashreplace")
