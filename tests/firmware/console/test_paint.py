"""Painter's output on a VT100; pyte is the VT100."""

import pyte
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.console.paint import Painter, Printer
from tests.firmware.console.emulated import ALLOWED, PRINTED

LINE = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=79)
FRAMES = st.lists(st.tuples(st.lists(LINE, min_size=1, max_size=23), st.booleans()), min_size=1, max_size=6)


@given(frames=FRAMES, rubbish=st.binary(max_size=200))
def test_a_screen_shows_the_last_frame_and_nothing_else(frames: list[tuple[list[str], bool]], rubbish: bytes) -> None:
    screen = pyte.Screen(80, 24)
    stream, painter = pyte.ByteStream(screen), Painter()
    stream.feed(b"kernel: says something\r\n" * 30)
    for lines, is_forgotten in frames:
        if is_forgotten:
            stream.feed(bytes(32 + octet % 95 for octet in rubbish))
            painter.forget()
        octets = painter.frame(lines)
        assert ALLOWED.fullmatch(octets)
        stream.feed(octets)
        shown = [line.rstrip() for line in screen.display]
        assert shown == [line.rstrip() for line in lines] + [""] * (24 - len(lines))
        assert (screen.cursor.y, screen.cursor.x) == (len(lines) - 1, len(lines[-1]))


def test_what_is_shown_already_is_not_sent_again() -> None:
    painter = Painter()
    first = painter.frame(["a" * 70, "b" * 70, "c"])
    assert painter.frame(["a" * 70, "b" * 70, "c"]) == b""
    again = painter.frame(["a" * 70, "B" * 70, "c"])
    assert b"a" not in again
    assert len(again) < len(first)
    painter.forget()
    assert len(painter.frame(["a" * 70, "B" * 70, "c"])) == len(first)


@pytest.mark.parametrize("text", ["\u00fc", "\u202e"])
def test_what_is_not_ascii_is_a_bug_of_the_caller(text: str) -> None:
    with pytest.raises(UnicodeEncodeError):
        Painter().frame([text])


@given(frames=FRAMES)
def test_a_printer_gets_lines_and_nothing_else(frames: list[tuple[list[str], bool]]) -> None:
    printer, sent = Printer(), b""
    for lines, _ in frames:
        sent += printer.frame(lines)
    assert PRINTED.fullmatch(sent)
    assert sent.decode() == "".join("\r\n" + "\r\n".join(lines) for lines, _ in frames)
