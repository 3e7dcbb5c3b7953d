"""Resolver of object classes and sets (X.681), whose rows map identifiers to types."""

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import fault
from asn1.importer.parser.lexer import Token, TokenKind
from asn1.importer.parser.type_parser import TypeParser
from asn1.importer.resolver.program import Program, Scope, Typed
from asn1.importer.resolver.sets import TypeResolver
from asn1.importer.resolver.values import number
from asn1.model import types

_CLAUSE = "X.681 12"


class Objects:
    """Resolves object classes and sets.

    Only the shape that the ITS standards use is supported: an identifier and a type.
    """

    def __init__(self, program: Program, resolve_type: TypeResolver) -> None:
        self._program = program
        self._resolve_type = resolve_type

    def class_(self, key: str, assignment: syntax.ClassAssignment) -> types.ObjectClass:
        """Resolve a class of objects (X.681 9).

        Raises ImportFault if its fields are not one identifier and one type.
        """
        identifier, type_field = _fields(assignment)
        assert identifier.type is not None
        id_type = self._resolve_type(identifier.type, Scope(key))
        return types.ObjectClass(assignment.name, identifier.name, id_type, type_field.name)

    def set_(self, key: str, assignment: syntax.SetAssignment) -> types.ObjectSet:
        """Resolve an object set. Rows keep the order of the text; those after the ellipsis are included.

        Raises ImportFault for a set of values, a row that is not an object set, and two rows with one identifier (X.681
        12.8).
        """
        class_key, class_ = self._class_of(key, assignment)
        parser = _RowParser(assignment, class_)
        rows: list[types.ObjectRow] = []
        for row in parser.rows():
            if isinstance(row, syntax.Reference):
                rows += self._referenced(row, Scope(key)).rows
            else:
                type_, value = row
                rows.append(
                    types.ObjectRow(
                        self._identifier(value, key, class_key, class_), self._resolve_type(type_, Scope(key))
                    )
                )
        values = [row.value for row in rows]
        if len(set(values)) < len(values):
            raise fault(assignment.place, f"two rows of {assignment.name} have the same identifier", "X.681 12.8")
        reference = types.Reference(class_key, class_.name)
        return types.ObjectSet(assignment.name, reference, tuple(rows), parser.is_extensible)

    def _class_of(self, key: str, assignment: syntax.SetAssignment) -> tuple[str, syntax.ClassAssignment]:
        governor = assignment.governor
        if isinstance(governor, syntax.Reference):
            class_key, found = self._program.find(Scope(key), governor.name, governor.place, governor.module)
            if isinstance(found, syntax.ClassAssignment):
                return class_key, found
        raise fault(assignment.place, f"{assignment.name} is a value set", "X.680 16.6")

    def _identifier(self, value: syntax.Value, key: str, class_key: str, class_: syntax.ClassAssignment) -> int:
        identifier, _ = _fields(class_)
        assert identifier.type is not None
        return number(self._program, value, Scope(key), Typed(identifier.type, Scope(class_key)))

    def _referenced(self, reference: syntax.Reference, scope: Scope) -> types.ObjectSet:
        key, assignment = self._program.find(scope, reference.name, reference.place, reference.module)
        if not isinstance(assignment, syntax.SetAssignment):
            raise fault(reference.place, f"{reference.name} is not an object set", _CLAUSE)
        with self._program.step(reference.place):
            return self.set_(key, assignment)


def _fields(class_: syntax.ClassAssignment) -> tuple[syntax.ClassField, syntax.ClassField]:
    """Return the identifier field and the type field of a class."""
    fixed = [one for one in class_.fields if one.type is not None and one.name[1].islower()]
    open_ = [one for one in class_.fields if one.type is None and one.name[1].isupper()]
    if len(class_.fields) != 2 or len(fixed) != 1 or len(open_) != 1:
        raise fault(class_.place, f"{class_.name}: unsupported: a field that is not an identifier or a type", "X.681 9")
    return fixed[0], open_[0]


class _RowParser(TypeParser):
    """Parser of the rows in an object set: { {...} | {...}, ... }."""

    def __init__(self, assignment: syntax.SetAssignment, class_: syntax.ClassAssignment) -> None:
        end = Token(TokenKind.END, "", assignment.place, (), False)
        super().__init__([*assignment.inside, end])
        identifier, type_field = _fields(class_)
        words = [word for word in class_.syntax if word not in {"[", "]", ","}]
        self._words = words or [identifier.name, identifier.name, type_field.name, type_field.name]
        self._is_plain = not words
        self._identifier = identifier.name
        self.is_extensible = False

    def rows(self) -> list[tuple[syntax.Type, syntax.Value] | syntax.Reference]:
        found: list[tuple[syntax.Type, syntax.Value] | syntax.Reference] = []
        while self.token.kind is not TokenKind.END:
            if self.takes("..."):
                self.is_extensible = True
            elif self.sees("{"):
                found.append(self._row())
            else:
                found.append(syntax.Reference(place=self.place, name=self.reference(_CLAUSE)))
            if not (self.takes("|") or self.takes(",") or self.takes("UNION")):
                break
        if self.token.kind is not TokenKind.END:
            self.refuse("another row", _CLAUSE)
        return found

    def _row(self) -> tuple[syntax.Type, syntax.Value]:
        place = self.needs("{", _CLAUSE)
        type_: syntax.Type | None = None
        value: syntax.Value | None = None
        for at, word in enumerate(self._words):
            if self._is_plain and at % 2 == 0:
                self._field_name(word)
            elif not word.startswith("&"):
                self.needs(word, "X.681 11.6")
            elif word == self._identifier:
                value = self.value()
            else:
                type_ = self.type()
            if self._is_plain and at == 1:
                self.takes(",")
        self.needs("}", _CLAUSE)
        if type_ is None or value is None:
            raise fault(place, "invalid: row without identifier or type", "X.681 11.6")
        return type_, value

    def _field_name(self, word: str) -> None:
        if self.token.kind is not TokenKind.FIELD or self.token.text != word:
            self.refuse(word, "X.681 11.5")
        self.next()
