"""Parser of ASN.1 types.

Sources: X.680 clauses 17 to 48, class fields of X.681 clause 14, parameters of X.683.
"""

import dataclasses
import re

from asn1.importer.parser import syntax
from asn1.importer.parser.constraint_parser import ConstraintParser
from asn1.importer.parser.fault import fault
from asn1.importer.parser.lexer import TokenKind

# Builtin types of one or two words (X.680 17.2). The resolver reports the unsupported ones.
_TWO_WORDS = {("OCTET", "STRING"), ("OBJECT", "IDENTIFIER"), ("CHARACTER", "STRING"), ("EMBEDDED", "PDV")}
_ONE_WORD = {
    "BOOLEAN", "NULL", "REAL", "EXTERNAL", "RELATIVE-OID", "OID-IRI", "RELATIVE-OID-IRI", "DATE", "TIME", "TIME-OF-DAY",
    "DATE-TIME", "DURATION", "GeneralizedTime", "UTCTime", "ObjectDescriptor", "BMPString", "GeneralString",
    "GraphicString", "IA5String", "ISO646String", "NumericString", "PrintableString", "TeletexString", "T61String",
    "UniversalString", "UTF8String", "VideotexString", "VisibleString",
}  # fmt: skip
_UNIT = re.compile(r"(?:@units?\b:?|^[ \t*]*Unit:)[ \t]*([^\n]*)", re.MULTILINE)


def unit_of(comments: tuple[str, ...]) -> str | None:
    """Return the text of `@unit` in comments, unchanged; None without one. The last /** comment */ counts."""
    documentation = [comment for comment in comments if comment.startswith("*")][-1:]
    found = [match.strip() for comment in documentation or comments for match in _UNIT.findall(comment)]
    return found[-1] if found and found[-1] else None


class TypeParser(ConstraintParser):
    """Parser of a type, with its tag and its constraints."""

    def type(self) -> syntax.Type:
        """Parse a type with its tag and constraints (X.680 17). Raises ImportFault for the type CLASS."""
        self.deeper()
        tag = self._tag() if self.sees("[") else None
        base = self._base()
        constraints = [*base.constraints]
        while self.sees("("):
            constraints.append(self.constraint())
        self.depth -= 1
        return dataclasses.replace(base, constraints=tuple(constraints), tag=tag or base.tag)

    def _tag(self) -> syntax.Tag:
        self.needs("[", "X.680 31.2")
        class_ = next((word for word in ("UNIVERSAL", "APPLICATION", "PRIVATE") if self.takes(word)), "")
        tag = syntax.Tag(class_, self.value())
        self.needs("]", "X.680 31.2")
        if not self.takes("IMPLICIT"):
            self.takes("EXPLICIT")
        return tag

    def _base(self) -> syntax.Type:
        place = self.place
        if not self.sees_reference():
            self.refuse("a type", "X.680 17")
        word = self.next().text
        if (word, self.token.text) in _TWO_WORDS:
            return syntax.Plain(place=place, name=f"{word} {self.next().text}")
        if word in _ONE_WORD:
            return syntax.Plain(place=place, name=word)
        match word:
            case "INTEGER":
                return syntax.WithItems(place=place, name=word, items=self._items("X.680 19"))
            case "BIT":
                self.needs("STRING", "X.680 22")
                return syntax.WithItems(place=place, name="BIT STRING", items=self._items("X.680 22"))
            case "ENUMERATED":
                return self._enumerated()
            case "CHOICE":
                return syntax.Structure(place=place, name=word, members=self._alternatives())
            case "SEQUENCE" | "SET":
                return self._sequence(word)
            case "ANY":
                if self.takes("DEFINED", "BY"):
                    self.identifier("X.680 17")
                return syntax.Plain(place=place, name=word)
            case "INSTANCE":
                self.needs("OF", "X.680 17")
                self.reference("X.680 17")
                return syntax.Plain(place=place, name=word)
            case "CLASS":
                raise fault(place, f"unsupported: {word}", "X.680 17")
        return self._reference(word)

    def _reference(self, word: str) -> syntax.Type:
        place = self.tokens[self.at - 1].place
        if self.sees(".") and self.peek().kind is TokenKind.FIELD:
            self.next()
            return self._field(word)
        module = None
        if self.sees(".") and self.peek().kind is TokenKind.NAME:
            self.next()
            module, word = word, self.reference("X.680 14.1")
        actuals = self._actuals() if self.sees("{") else None
        return syntax.Reference(place=place, name=word, module=module, actuals=actuals)

    def _field(self, class_: str) -> syntax.FieldOf:
        place = self.place
        field = self.next().text
        if self.sees("."):
            raise fault(place, "unsupported: field of a field", "X.681 14")
        if not self.sees("(", "{"):
            return syntax.FieldOf(place=place, class_=class_, field=field)
        self.needs("(", "X.682 10")
        self.needs("{", "X.682 10")
        set_, selector = self.reference("X.682 10"), None
        self.needs("}", "X.682 10")
        if self.takes("{", "@"):
            self.takes(".")
            selector = self.identifier("X.682 10.7")
            if self.sees(".") or self.sees(","):
                raise fault(self.place, "unsupported: selector outside the same SEQUENCE", "X.682 10.7")
            self.needs("}", "X.682 10.7")
        self.needs(")", "X.682 10")
        return syntax.FieldOf(place=place, class_=class_, field=field, set_=set_, selector=selector)

    def _actuals(self) -> tuple[syntax.Actual, ...]:
        self.needs("{", "X.683 9")
        found = [self._actual()]
        while self.takes(","):
            found.append(self._actual())
        self.needs("}", "X.683 9")
        return tuple(found)

    def _actual(self) -> syntax.Actual:
        place, first = self.place, self.at
        if self.takes("{"):
            set_ = self.reference("X.683 9.5")
            self.needs("}", "X.683 9.5")
            return syntax.Actual(place=place, text=set_, set_=set_)
        if self.sees_reference() and self.token.text not in {"TRUE", "FALSE"}:
            type_ = self.type()
            return syntax.Actual(place=place, text=self._text(first), type=type_)
        value = self.value()
        return syntax.Actual(place=place, text=self._text(first), value=value)

    def _text(self, first: int) -> str:
        return " ".join(token.text for token in self.tokens[first : self.at])

    def _items(self, clause: str) -> tuple[syntax.Item, ...]:
        """Parse { name(number), ... } of an INTEGER or a BIT STRING; empty without braces."""
        if not self.takes("{"):
            return ()
        found = [self._item(clause)]
        while self.takes(","):
            found.append(self._item(clause))
        self.needs("}", clause)
        return tuple(found)

    def _item(self, clause: str) -> syntax.Item:
        place, name = self.place, self.identifier(clause)
        self.needs("(", clause)
        value = self.value()
        self.needs(")", clause)
        return syntax.Item(place, name, value)

    def _enumerated(self) -> syntax.Enumerated:
        place = self.needs("{", "X.680 20")
        lists: list[list[syntax.Item]] = [[]]
        while not self.sees("}"):
            if self.takes("..."):
                lists.append([])
            else:
                lists[-1].append(self._enumeration_item())
            if not self.takes(","):
                break
        self.needs("}", "X.680 20")
        if len(lists) > 2 or not lists[0]:
            raise fault(place, "invalid: ENUMERATED without items or with two ellipses", "X.680 20.1")
        additions = tuple(lists[1]) if len(lists) == 2 else ()
        return syntax.Enumerated(place=place, root=tuple(lists[0]), is_extensible=len(lists) == 2, additions=additions)

    def _enumeration_item(self) -> syntax.Item:
        if self.peek().text == "(":
            return self._item("X.680 20")
        place = self.place
        return syntax.Item(place, self.identifier("X.680 20"), None)

    def _sequence(self, word: str) -> syntax.Type:
        place = self.tokens[self.at - 1].place
        if self.sees("{"):
            return syntax.Structure(place=place, name=word, members=self._members())
        constraints: list[syntax.Constraint] = []
        if self.sees("SIZE"):
            constraints.append(syntax.Constraint(self.place, self.size()))
        elif self.sees("("):
            constraints.append(self.constraint())
        self.needs("OF", "X.680 26")
        if self.token.kind is TokenKind.NAME and self.token.text[0].islower():
            raise fault(self.place, "unsupported: list with a named element", "X.680 26.1")
        element = self.type()
        return syntax.ListOf(place=place, is_set=word == "SET", element=element, constraints=tuple(constraints))

    def _alternatives(self) -> syntax.Members:
        place, members = self.place, self._members()
        if not members.root:
            raise fault(place, "invalid: CHOICE without alternatives", "X.680 29.1")
        return members

    def _members(self) -> syntax.Members:
        place = self.needs("{", "X.680 25")
        lists: list[list[syntax.Member]] = [[]]
        while not self.sees("}"):
            if self.takes("..."):
                if self.sees("!"):
                    raise fault(self.place, "unsupported: exception identifier", "X.680 53")
                lists.append([])
            elif len(lists) == 2 and self.takes("[["):
                lists[-1].append(self._group())
            else:
                lists[-1].append(self._component())
            if not self.takes(","):
                break
        self.needs("}", "X.680 25")
        if len(lists) > 3:
            raise fault(place, "more than two ellipses", "X.680 25.1")
        root, additions, tail = [*lists, [], []][:3]
        # Groups occur only between the ellipses, so _plain() removes nothing here.
        return syntax.Members(_plain(root), len(lists) > 1, tuple(additions), _plain(tail))

    def _group(self) -> syntax.Group:
        place, version = self.place, None
        if self.token.kind is TokenKind.NUMBER:
            version = self.number("X.680 25.1")
            self.needs(":", "X.680 25.1")
        components = [self._component()]
        while self.takes(","):
            components.append(self._component())
        self.needs("]]", "X.680 25.1")
        return syntax.Group(place, tuple(components), version)

    def _component(self) -> syntax.Component | syntax.ComponentsOf:
        place, unit = self.place, unit_of(self.token.comments)
        if self.takes("COMPONENTS"):
            self.needs("OF", "X.680 25.5")
            return syntax.ComponentsOf(place, self.type())
        name = self.identifier("X.680 25")
        type_ = self.type()
        is_optional = self.takes("OPTIONAL")
        default = self.value() if self.takes("DEFAULT") else None
        return syntax.Component(place, name, type_, is_optional, default, unit)


def _plain(members: list[syntax.Member]) -> tuple[syntax.Component | syntax.ComponentsOf, ...]:
    return tuple(member for member in members if not isinstance(member, syntax.Group))
