"""A place in a list of tokens, and the small questions a parser asks there."""

from collections.abc import Sequence
from typing import NoReturn

from asn1.importer import syntax
from asn1.importer.fault import Place, fault
from asn1.importer.lexer import Kind, Token

# What nests deeper is an attack, not a standard (the deepest of them goes to 12).
MAX_DEPTH = 60


class Cursor:
    """Reads tokens from left to right; the last one has to be of kind END."""

    def __init__(self, tokens: Sequence[Token]) -> None:
        self.tokens = tokens
        self.at = 0
        self.depth = 0

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    @property
    def place(self) -> Place:
        return self.token.place

    def peek(self, ahead: int = 1) -> Token:
        return self.tokens[min(self.at + ahead, len(self.tokens) - 1)]

    def next(self) -> Token:
        token = self.token
        if token.kind is not Kind.END:
            self.at += 1
        return token

    def sees(self, *texts: str) -> bool:
        """Whether the next tokens are these names, numbers or symbols; a string in quotes never is."""
        return all(_is(self.peek(ahead), text) for ahead, text in enumerate(texts))

    def takes(self, *texts: str) -> bool:
        """The same, and moves behind them."""
        if not self.sees(*texts):
            return False
        self.at += len(texts)
        return True

    def needs(self, text: str, clause: str) -> Place:
        """Moves behind this token, which has to be next. Returns its place."""
        place = self.place
        if not self.takes(text):
            self.refuse(repr(text), clause)
        return place

    def sees_reference(self) -> bool:
        """A name that begins with a capital: a type, a class, a set, a module or a reserved word."""
        return self.token.kind is Kind.NAME and self.token.text[0].isupper()

    def identifier(self, clause: str) -> str:
        """A name that begins with a small letter."""
        if self.token.kind is not Kind.NAME or not self.token.text[0].islower():
            self.refuse("an identifier", clause)
        return self.next().text

    def reference(self, clause: str) -> str:
        if not self.sees_reference():
            self.refuse("a reference (a name with a capital)", clause)
        return self.next().text

    def number(self, clause: str) -> int:
        if self.token.kind is not Kind.NUMBER:
            self.refuse("a number", clause)
        return self.whole(self.next())

    @staticmethod
    def whole(token: Token) -> int:
        # No number of a standard is longer, and Python refuses 4300 digits.
        if len(token.text) > 100:
            raise fault(token.place, f"a number of {len(token.text)} digits")
        return int(token.text)

    def braces(self, clause: str) -> tuple[Token, ...]:
        """The tokens between { and its }, which are taken too."""
        start = self.needs("{", clause)
        first, depth = self.at, 1
        while depth:
            token = self.next()
            if token.kind is Kind.END:
                raise fault(start, "this { is not closed", clause)
            if token.kind is Kind.SYMBOL:
                depth += {"{": 1, "}": -1}.get(token.text, 0)
        return tuple(self.tokens[first : self.at - 1])

    def deeper(self) -> None:
        """Called where the grammar recurs; `depth` is taken back by who called it."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise fault(self.place, f"nested deeper than {MAX_DEPTH}")

    def refuse(self, expected: str, clause: str) -> NoReturn:
        found = self.token
        what = found.kind.value if found.kind is Kind.END else repr(found.text)
        raise fault(found.place, f"expected {expected}, found {what}", clause)

    def value(self) -> syntax.Value:
        """A value, as far as one token or pair of braces tells (X.680 17)."""
        token = self.token
        match token.kind:
            case Kind.NUMBER:
                self.next()
                if self.sees(".") and self.peek().kind is Kind.NUMBER:
                    raise fault(token.place, "a REAL value", "X.680 21")
                return syntax.Number(token.place, self.whole(token))
            case Kind.TEXT:
                return syntax.Text(token.place, self.next().text.replace('""', '"'))
            case Kind.BITS:
                return syntax.Bits(token.place, "".join(self.next().text.split()))
            case Kind.OCTETS:
                return syntax.Octets(token.place, "".join(self.next().text.split()))
            case Kind.NAME:
                return self._word()
        if self.takes("-"):
            return syntax.Number(token.place, -self.number("X.680 19"))
        if not self.sees("{"):
            self.refuse("a value", "X.680 17")
        return syntax.Braces(token.place, self.braces("X.680 17"))

    def _word(self) -> syntax.Word:
        token = self.next()
        if token.text[0].isupper() and self.sees(".") and self.peek().kind is Kind.NAME:
            self.next()
            return syntax.Word(token.place, self.next().text, token.text)
        if self.sees(":"):
            raise fault(token.place, "a value of a CHOICE", "X.680 29.10")
        return syntax.Word(token.place, token.text)


def _is(token: Token, text: str) -> bool:
    return token.text == text and token.kind in {Kind.NAME, Kind.SYMBOL, Kind.NUMBER}
