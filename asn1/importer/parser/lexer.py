"""Lexer of ASN.1 text (X.680 clause 12).

Tokens keep their line and the comments before them.
"""

import re
from enum import Enum
from typing import NamedTuple

from asn1.importer.parser.fault import Place, fault


class TokenKind(Enum):
    """Kind of a token. NAME is a reference, an identifier or a reserved word; only the parser can distinguish them."""

    NAME = "a name"
    FIELD = "a field name"
    NUMBER = "a number"
    TEXT = "a character string"
    BITS = "a bit string"
    OCTETS = "a hexadecimal string"
    SYMBOL = "a symbol"
    END = "the end of the text"


class Token(NamedTuple):
    """A token.

    text         without quotes.
    comments     comments between the previous token and this one, without comment marks.
    starts_line  it is the first token of its line.
    """

    kind: TokenKind
    text: str
    place: Place
    comments: tuple[str, ...]
    starts_line: bool


_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\f\v\u00a0\ufeff]+)
      | (?P<newline>\n)
      | (?P<block>/\*)
      | (?P<line>--)
      | (?P<NAME>[A-Za-z](?:-?[A-Za-z0-9])*)
      | (?P<FIELD>&[A-Za-z](?:-?[A-Za-z0-9])*)
      | (?P<NUMBER>[0-9]+)
      | "(?P<TEXT>(?:[^"]|"")*)"
      | '(?P<BITS>[01\s]*)'B
      | '(?P<OCTETS>[0-9A-F\s]*)'H
      | (?P<SYMBOL>::=|\.\.\.|\.\.|\[\[|\]\]|[][{}(),;:|^@.!<>*/=-])
    """,
    re.VERBOSE,
)
_BLOCK_MARK = re.compile(r"/\*|\*/")
_LINE_END = re.compile(r"--|\n|\Z")


def tokens(text: str, file: str) -> list[Token]:
    """Split a file into tokens; the last has the kind END. Raises ImportFault for an invalid character."""
    found: list[Token] = []
    comments: list[str] = []
    at, line, starts_line = 0, 1, True
    while at < len(text):
        match = _TOKEN.match(text, at)
        place = Place(file, line)
        if match is None:
            raise fault(place, f"invalid character {text[at]!r}", "X.680 12")
        at = match.end()
        what = match.lastgroup
        if what == "block":
            at = _block_end(text, at, place)
            comments.append(text[match.end() : at - 2])
        elif what == "line":
            end = _LINE_END.search(text, at)
            assert end is not None  # \Z matches
            comments.append(text[at : end.start()])
            at = end.end() if end.group() == "--" else end.start()
        elif what not in {"space", "newline"}:
            assert what is not None
            found.append(Token(TokenKind[what], match[what], place, tuple(comments), starts_line))
            comments = []
        newlines = text.count("\n", match.start(), at)
        line += newlines
        if newlines:
            starts_line = True
        elif what not in {"space", "block", "line"}:
            starts_line = False
    found.append(Token(TokenKind.END, "", Place(file, line), tuple(comments), True))
    return found


def _block_end(text: str, at: int, place: Place) -> int:
    """Return the offset after a /* comment */. These comments nest (X.680 12.6.4)."""
    depth = 1
    while depth:
        mark = _BLOCK_MARK.search(text, at)
        if mark is None:
            raise fault(place, "comment without end", "X.680 12.6.4")
        depth += 1 if mark.group() == "/*" else -1
        at = mark.end()
    return at
