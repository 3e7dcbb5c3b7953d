"""Parser of constraints: X.680 clauses 49 to 51, and CONTAINING of X.682 clause 11."""

from abc import abstractmethod

from asn1.importer.parser import syntax
from asn1.importer.parser.cursor import Cursor
from asn1.importer.parser.fault import fault

# Words that are values, although they begin with a capital like names of types.
_VALUE_WORDS = {"MIN", "MAX", "TRUE", "FALSE", "NULL", "PLUS-INFINITY", "MINUS-INFINITY", "NOT-A-NUMBER"}
_UNSUPPORTED = {"PATTERN": "X.680 51.9", "SETTINGS": "X.680 51.10", "CONSTRAINED": "X.682 9", "ENCODED": "X.682 11"}


class ConstraintParser(Cursor):
    """Parser of the constraints in parentheses after a type."""

    @abstractmethod
    def type(self) -> syntax.Type: ...

    def constraint(self) -> syntax.Constraint:
        """Parse ( element sets ). Raises ImportFault for an exception identifier (X.680 53)."""
        place = self.needs("(", "X.680 49.6")
        root = self._union()
        is_extensible, additions = False, None
        if self.takes(","):
            self.needs("...", "X.680 50.1")
            is_extensible = True
            if self.takes(","):
                additions = self._union()
        if self.sees("!"):
            raise fault(self.place, "unsupported: exception identifier", "X.680 53")
        self.needs(")", "X.680 49.6")
        return syntax.Constraint(place, root, is_extensible, additions)

    def size(self) -> syntax.SizeOf:
        """Parse SIZE (...)."""
        place = self.needs("SIZE", "X.680 51.5")
        return syntax.SizeOf(place, self.constraint())

    def _union(self) -> syntax.Elements:
        self.deeper()
        place = self.place
        if self.takes("ALL"):
            self.needs("EXCEPT", "X.680 50.1")
            found: syntax.Elements = syntax.Except(place, None, self._element())
        else:
            members = [self._intersection()]
            while self.takes("|") or self.takes("UNION"):
                members.append(self._intersection())
            found = members[0] if len(members) == 1 else syntax.Union(tuple(members))
        self.depth -= 1
        return found

    def _intersection(self) -> syntax.Elements:
        members = [self._difference()]
        while self.takes("^") or self.takes("INTERSECTION"):
            members.append(self._difference())
        return members[0] if len(members) == 1 else syntax.Intersection(tuple(members))

    def _difference(self) -> syntax.Elements:
        base = self._element()
        place = self.place
        return syntax.Except(place, base, self._element()) if self.takes("EXCEPT") else base

    def _element(self) -> syntax.Elements:
        place = self.place
        if self.takes("("):
            inside = self._union()
            self.needs(")", "X.680 50.1")
            return inside
        if self.sees("SIZE"):
            return self.size()
        if self.takes("FROM"):
            return syntax.From(place, self.constraint())
        if self.takes("WITH"):
            return self._with()
        if self.takes("CONTAINING"):
            return syntax.Containing(place, self.type())
        if self.takes("INCLUDES"):
            return syntax.Included(place, self.type())
        if self.token.text in _UNSUPPORTED:
            raise fault(place, f"unsupported: {self.token.text}", _UNSUPPORTED[self.token.text])
        if self.sees_reference() and self.token.text not in _VALUE_WORDS and self.peek().text != ".":
            return syntax.Included(place, self.type())
        return self._range()

    def _range(self) -> syntax.Elements:
        low = self.value()
        excludes_low = self.sees("<", "..")
        if not (self.takes("<", "..") or self.takes("..")):
            return syntax.Single(low)
        excludes_high = self.takes("<")
        return syntax.Between(low, self.value(), excludes_low, excludes_high)

    def _with(self) -> syntax.Elements:
        place = self.place
        if self.takes("COMPONENT"):
            return syntax.With(place, self.constraint())
        self.needs("COMPONENTS", "X.680 51.8")
        self.needs("{", "X.680 51.8")
        partial = self.takes("...")
        lines: list[syntax.WithLine] = []
        if partial and not self.sees("}"):
            self.needs(",", "X.680 51.8")
        while not self.sees("}"):
            lines.append(self._with_line())
            if not self.takes(","):
                break
        self.needs("}", "X.680 51.8")
        return syntax.WithAll(place, partial, tuple(lines))

    def _with_line(self) -> syntax.WithLine:
        place = self.place
        name = self.identifier("X.680 51.8")
        constraint = self.constraint() if self.sees("(") else None
        presence = next((word for word in ("PRESENT", "ABSENT", "OPTIONAL") if self.takes(word)), None)
        return syntax.WithLine(place, name, constraint, presence)
