"""Parser of ASN.1 modules.

Sources: X.680 clauses 13 to 16, classes and object sets of X.681, templates of X.683 clause 8.
"""

from typing import NamedTuple

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import ImportFault, Place, Problem, fault
from asn1.importer.parser.lexer import Token, TokenKind, tokens
from asn1.importer.parser.type_parser import TypeParser, unit_of

# Phrase by which TS 102 894-2, from v2.1.1 on, marks superseded elements.
SUPERSEDED = "kept for backwards compatibility reasons only"


class Reading(NamedTuple):
    """Result of reading a file.

    modules   modules with every definition that could be parsed.
    problems  errors.
    lost      names of definitions that could not be parsed.
    """

    modules: list[syntax.Module]
    problems: list[Problem]
    lost: set[str]

    def others(self, problems: list[Problem]) -> list[Problem]:
        """Return the problems of a later stage that are not consequences of definitions that failed to parse."""
        follow = {text for name in self.lost for text in (f"{name} is neither defined nor imported", f"has no {name};")}
        return [problem for problem in problems if not any(text in f"{problem.text};" for text in follow)]


def parse(text: str, file: str) -> list[syntax.Module]:
    """Parse the modules of a file, in its order. Raises ImportFault with all errors."""
    reading = read(text, file)
    if reading.problems:
        raise ImportFault(reading.problems)
    return reading.modules


def read(text: str, file: str) -> Reading:
    """Parse as much of a file as possible. Raises ImportFault if a token is invalid."""
    parser = _ModuleParser(tokens(text, file))
    modules: list[syntax.Module] = []
    try:
        while parser.token.kind is not TokenKind.END:
            modules.append(parser.module())
    except ImportFault as error:
        parser.problems += error.problems
    if not parser.problems and not modules:
        parser.problems.append(Problem(Place(file, 1), "no module in this file", "X.680 13.1"))
    return Reading(modules, parser.problems, parser.lost)


class _ModuleParser(TypeParser):
    def __init__(self, all_tokens: list[Token]) -> None:
        super().__init__(all_tokens)
        self.problems: list[Problem] = []
        self.lost: set[str] = set()

    def module(self) -> syntax.Module:
        place = self.place
        name = self.reference("X.680 13.1")
        oid = oid_text(self.braces("X.680 13.1")) if self.sees("{") else ""
        if self.token.kind is TokenKind.TEXT:
            self.next()
        self.needs("DEFINITIONS", "X.680 13.1")
        automatic = self._tag_default()
        if self.sees("EXTENSIBILITY", "IMPLIED"):
            raise fault(self.place, "unsupported: EXTENSIBILITY IMPLIED", "X.680 13.4")
        self.needs("::=", "X.680 13.1")
        self.needs("BEGIN", "X.680 13.1")
        if self.takes("EXPORTS"):
            self._skip_behind(";")
        imports = self._imports() if self.takes("IMPORTS") else {}
        first = self.at
        assignments = self._assignments()
        body = tuple(token.text for token in self.tokens[first : self.at])
        self.needs("END", "X.680 13.1")
        return syntax.Module(place, name, oid, automatic, imports, assignments, body)

    def _tag_default(self) -> bool:
        for word in ("AUTOMATIC", "EXPLICIT", "IMPLICIT"):
            if self.takes(word):
                self.needs("TAGS", "X.680 13.1")
                return word == "AUTOMATIC"
        return False

    def _skip_behind(self, text: str) -> None:
        while not self.takes(text):
            if self.next().kind is TokenKind.END:
                self.refuse(repr(text), "X.680 13.1")

    def _imports(self) -> dict[str, syntax.Import]:
        found: dict[str, syntax.Import] = {}
        while not self.takes(";"):
            names = [self._imported()]
            while self.takes(","):
                names.append(self._imported())
            self.needs("FROM", "X.680 13.1")
            place, module = self.place, self.reference("X.680 13.1")
            oid = oid_text(self.braces("X.680 13.1")) if self.sees("{") else ""
            selection = next((word for word in ("SUCCESSORS", "DESCENDANTS") if self.takes("WITH", word)), "")
            found.update({name: syntax.Import(place, module, oid, tuple(names), selection) for name in names})
        return found

    def _imported(self) -> str:
        if self.token.kind is not TokenKind.NAME:
            self.refuse("a name to import", "X.680 13.1")
        name = self.next().text
        self.takes("{", "}")
        return name

    def _assignments(self) -> dict[str, syntax.Assignment]:
        """Parse all assignments. After an error it continues with the next one, to report all errors at once."""
        found: dict[str, syntax.Assignment] = {}
        while not self.sees("END") and self.token.kind is not TokenKind.END:
            start, self.depth = self.at, 0
            try:
                assignment = self._assignment()
                if assignment.name in found:
                    raise fault(assignment.place, f"{assignment.name} is defined twice", "X.680 13.3")
                found[assignment.name] = assignment
            except ImportFault as error:
                self.problems += error.problems
                self.lost.add(self.tokens[start].text)
                self.at = max(self.at, start + 1)
                self._skip_to_assignment()
        return found

    def _skip_to_assignment(self) -> None:
        while self.token.kind is not TokenKind.END and not self.sees("END") and not self._begins_assignment():
            self.next()

    def _begins_assignment(self) -> bool:
        if not self.token.starts_line or self.token.kind is not TokenKind.NAME:
            return False
        for ahead in range(1, 12):
            following = self.peek(ahead)
            if following.text == "::=":
                return True
            if following.starts_line:
                return False
        return False

    def _assignment(self) -> syntax.Assignment:
        place, unit = self.place, unit_of(self.token.comments)
        is_superseded = any(SUPERSEDED in comment for comment in self.token.comments[-1:])
        if self.token.kind is TokenKind.NAME and self.token.text[0].islower():
            name, type_ = self.next().text, self.type()
            self.needs("::=", "X.680 16.2")
            return syntax.ValueAssignment(place=place, name=name, type=type_, value=self.value())
        name = self.reference("X.680 16")
        formals = self._formals() if self.sees("{") else ()
        if not self.takes("::="):
            governor = self.type()
            self.needs("::=", "X.680 16")
            inside = self.braces("X.681 12")
            return syntax.SetAssignment(place=place, name=name, formals=formals, governor=governor, inside=inside)
        if self.takes("CLASS"):
            fields, words = self._class()
            return syntax.ClassAssignment(place=place, name=name, formals=formals, fields=fields, syntax=words)
        type_ = self.type()
        return syntax.TypeAssignment(
            place=place, name=name, formals=formals, type=type_, unit=unit, is_superseded=is_superseded
        )

    def _formals(self) -> tuple[syntax.Formal, ...]:
        """Parse {Governor : Name, Name, ...}."""
        self.needs("{", "X.683 8")
        found: list[syntax.Formal] = []
        while True:
            governor = ""
            if self.peek().text == ":":
                governor = self.reference("X.683 8")
                self.needs(":", "X.683 8")
            if self.token.kind is not TokenKind.NAME:
                self.refuse("a parameter", "X.683 8")
            found.append(syntax.Formal(self.next().text, governor))
            if not self.takes(","):
                break
        self.needs("}", "X.683 8")
        return tuple(found)

    def _class(self) -> tuple[tuple[syntax.ClassField, ...], tuple[str, ...]]:
        self.needs("{", "X.681 9")
        fields = [self._class_field()]
        while self.takes(","):
            fields.append(self._class_field())
        self.needs("}", "X.681 9")
        words: tuple[str, ...] = ()
        if self.takes("WITH", "SYNTAX"):
            words = tuple(token.text for token in self.braces("X.681 10"))
        return tuple(fields), words

    def _class_field(self) -> syntax.ClassField:
        place = self.place
        if self.token.kind is not TokenKind.FIELD:
            self.refuse("a field", "X.681 9")
        name = self.next().text
        type_ = self.type() if self.sees_reference() and self.token.text not in {"OPTIONAL", "DEFAULT"} else None
        self.takes("UNIQUE")
        if self.sees("OPTIONAL") or self.sees("DEFAULT"):
            raise fault(place, f"the field {name} of a class may be absent", "X.681 9")
        return syntax.ClassField(place=place, name=name, type=type_)


def oid_text(inside: tuple[Token, ...]) -> str:
    """Return an object identifier with normalised spacing: { itu-t(0) identified-organization(4) etsi(0) }."""
    text = ""
    for token in inside:
        text += token.text if token.text in {"(", ")"} or text.endswith("(") else f" {token.text}"
    return f"{{{text} }}"
