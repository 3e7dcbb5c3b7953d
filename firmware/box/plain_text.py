"""Text as editors of any computer leave it: byte order marks, UTF-16 and other ends of lines are theirs to choose."""

import codecs
import re

from firmware.box.note import Note, at, mistake

# Notepad's "Unicode" is UTF-16 with a mark; a mark of UTF-8 means nothing.
MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
BINARY = re.compile(rb"[\0-\x08\x0e-\x1f]")  # what no text has, in whatever encoding
RICH = b"{\\rtf"


def plain(name: str, octets: bytes, notes: list[Note], is_lenient: bool = False) -> str | None:
    """The text, with \\n at the end of each line; of what is no text that is noted, and there is none.

    is_lenient  an octet of another encoding is U+FFFD, for it spoils no more than its own line.
    """
    if octets.startswith(RICH):
        notes.append(mistake(name, "is rich text (RTF)", "in TextEdit choose Format, Make Plain Text, and save again"))
        return None
    mark, encoding = next(((mark, word) for mark, word in MARKS if octets.startswith(mark)), (b"", "utf-8"))
    body = octets[len(mark) :]
    if encoding == "utf-8" and b"\0" in body:
        notes.append(_nul(name, body))
        return None
    try:
        text = body.decode(encoding, "replace" if is_lenient and not BINARY.search(body) else "strict")
    except UnicodeDecodeError as error:
        line = body.count("\n".encode(encoding), 0, error.start) + 1
        what = f"octet 0x{body[error.start]:02x} is not {encoding.upper()}"
        notes.append(mistake(at(name, line), what, "save it as UTF-8"))
        return None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _nul(name: str, body: bytes) -> Note:
    if not body.strip(b"\0"):
        remedy = "it was not written to its end: copy it again, and eject the card before you pull it"
        return mistake(name, f"has {len(body)} octets of zero and nothing else", remedy)
    line = body.count(b"\n", 0, body.index(b"\0")) + 1
    return mistake(at(name, line), "has a zero octet: this is no text", "save it as UTF-8")
