"""Cursor in a list of tokens: tests, takes and requires the next ones."""

from collections.abc import Sequence
from typing import NoReturn

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import Place, fault
from asn1.importer.parser.lexer import Token, TokenKind

# Limit of nesting, against attacks. The standards nest at most 12 levels.
MAX_DEPTH = 60


class Cursor:
    """Position in a list of tokens, which moves forward. The last token has the kind END."""

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
        if token.kind is not TokenKind.END:
            self.at += 1
        return token

    def sees(self, *texts: str) -> bool:
        """Return whether the next tokens are these names, numbers or symbols. A string in quotes never matches."""
        return all(_is(self.peek(ahead), text) for ahead, text in enumerate(texts))

    def takes(self, *texts: str) -> bool:
        """Move past these tokens if they are next. Returns whether they were."""
        if not self.sees(*texts):
            return False
        self.at += len(texts)
        return True

    def needs(self, text: str, clause: str) -> Place:
        """Move past a token that must be next. Returns its place. Raises ImportFault for another token."""
        place = self.place
        if not self.takes(text):
            self.refuse(repr(text), clause)
        return place

    def sees_reference(self) -> bool:
        """Return whether the next token is a name with a capital: type, class, set, module or reserved word."""
        return self.token.kind is TokenKind.NAME and self.token.text[0].isupper()

    def identifier(self, clause: str) -> str:
        """Take a name that begins with a small letter. Raises ImportFault for another token."""
        if self.token.kind is not TokenKind.NAME or not self.token.text[0].islower():
            self.refuse("an identifier", clause)
        return self.next().text

    def reference(self, clause: str) -> str:
        if not self.sees_reference():
            self.refuse("a reference (a name with a capital)", clause)
        return self.next().text

    def number(self, clause: str) -> int:
        if self.token.kind is not TokenKind.NUMBER:
            self.refuse("a number", clause)
        return self.whole(self.next())

    @staticmethod
    def whole(token: Token) -> int:
        """Return the value of a number. Raises ImportFault above 100 digits."""
        # Numbers in the standards are shorter, and Python refuses more than 4300 digits.
        if len(token.text) > 100:
            raise fault(token.place, f"a number of {len(token.text)} digits")
        return int(token.text)

    def braces(self, clause: str) -> tuple[Token, ...]:
        """Take braces, and return the tokens between them.

        Raises ImportFault if the text ends before the closing one.
        """
        start = self.needs("{", clause)
        first, depth = self.at, 1
        while depth:
            token = self.next()
            if token.kind is TokenKind.END:
                raise fault(start, "missing } for this {", clause)
            if token.kind is TokenKind.SYMBOL:
                depth += {"{": 1, "}": -1}.get(token.text, 0)
        return tuple(self.tokens[first : self.at - 1])

    def deeper(self) -> None:
        """Count one level of nesting. Callers are the recursive rules; they decrement `depth` again.

        Raises ImportFault beyond MAX_DEPTH levels.
        """
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise fault(self.place, f"nested deeper than {MAX_DEPTH}")

    def refuse(self, expected: str, clause: str) -> NoReturn:
        """Raise ImportFault for an unexpected token. clause: of X.680 to X.683."""
        found = self.token
        what = found.kind.value if found.kind is TokenKind.END else repr(found.text)
        raise fault(found.place, f"expected {expected}, found {what}", clause)

    def value(self) -> syntax.Value:
        """Parse a value of one token or one pair of braces (X.680 17).

        Raises ImportFault for values of REAL (X.680 21) and of a CHOICE (X.680 29.10); the standards' modules have
        none.
        """
        token = self.token
        match token.kind:
            case TokenKind.NUMBER:
                self.next()
                if self.sees(".") and self.peek().kind is TokenKind.NUMBER:
                    raise fault(token.place, "unsupported: REAL value", "X.680 21")
                return syntax.Number(token.place, self.whole(token))
            case TokenKind.TEXT:
                return syntax.Text(token.place, self.next().text.replace('""', '"'))
            case TokenKind.BITS:
                return syntax.Bits(token.place, "".join(self.next().text.split()))
            case TokenKind.OCTETS:
                return syntax.Octets(token.place, "".join(self.next().text.split()))
            case TokenKind.NAME:
                return self._word()
        if self.takes("-"):
            return syntax.Number(token.place, -self.number("X.680 19"))
        if not self.sees("{"):
            self.refuse("a value", "X.680 17")
        return syntax.Braces(token.place, self.braces("X.680 17"))

    def _word(self) -> syntax.Word:
        token = self.next()
        if token.text[0].isupper() and self.sees(".") and self.peek().kind is TokenKind.NAME:
            self.next()
            return syntax.Word(token.place, self.next().text, token.text)
        if self.sees(":"):
            raise fault(token.place, "unsupported: value of a CHOICE", "X.680 29.10")
        return syntax.Word(token.place, token.text)


def _is(token: Token, text: str) -> bool:
    return token.text == text and token.kind in {TokenKind.NAME, TokenKind.SYMBOL, TokenKind.NUMBER}
