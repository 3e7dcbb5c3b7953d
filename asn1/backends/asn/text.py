"""Writer of ASN.1 text (X.680) from the schema, for other compilers.

The text has the definitions of a module in the order of the schema. Numbers replace value references. Every instance of
a parameterised type is a plain definition. COMPONENTS OF is expanded; tags are AUTOMATIC. Importing the text gives the
same schema.
"""

from collections.abc import Iterable
from collections.abc import Sequence as Many
from pathlib import Path
from typing import Literal, get_args

from asn1.model import types as t

Dialect = Literal["asn1tools", "pycrate"]
"""Compilers with unsupported constructs, and their replacements, which keep the encoding.

asn1tools  RELATIVE-OID is not parsed: OCTET STRING, whose encoding is the same (a length and octets, X.691 25).
pycrate    A union of WITH COMPONENTS is not parsed: what constrains components is left out (PER sees none, X.691 10.3).
"""


def write(schema: t.Schema, folder: Path, for_: Dialect | None = None) -> list[Path]:
    """Write one file <key>.asn per module; the folder is created. Returns the files in the order of the schema.

    for_  compiler with unsupported constructs to replace; None: write the complete schema.

    Raises ValueError for constraints or defaults without a notation in ASN.1.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for key, module in schema.modules.items():
        path = folder / f"{key}.asn"
        path.write_text(text(schema, module, for_))
        paths.append(path)
    return paths


def text(schema: t.Schema, module: t.Module, for_: Dialect | None = None) -> str:
    """Return one module as ASN.1."""
    assert for_ is None or for_ in get_args(Dialect)
    return _ModuleText(schema, module, for_).text()


class _ModuleText:
    """Text of one module. While it is written, symbols of other modules are collected for IMPORTS."""

    def __init__(self, schema: t.Schema, module: t.Module, for_: Dialect | None) -> None:
        self._schema = schema
        self._module = module
        self._for = for_
        self._imported: dict[str, set[str]] = {}

    def text(self) -> str:
        body = [
            *(self._class(one) for one in self._module.classes.values()),
            *(self._set(one) for one in self._module.sets.values()),
            *(self._definition(one) for one in self._module.definitions.values()),
        ]
        head = [
            f"-- {self._module.standard}, written from its schema by captain-asn1",
            f"{_title(self._module)} DEFINITIONS AUTOMATIC TAGS ::= BEGIN",
            *self._imports(),
        ]
        return "\n\n".join([*head, *body, "END"]) + "\n"

    # ---------------------------------------------------------------- assignments

    def _imports(self) -> list[str]:
        if not self._imported:
            return []
        parts = [
            f"  {', '.join(sorted(names))}\n    FROM {_title(self._schema.modules[key])}"
            for key, names in sorted(self._imported.items())
        ]
        return ["IMPORTS\n" + "\n".join(parts) + ";"]

    def _definition(self, definition: t.Definition) -> str:
        unit = f"{_unit(definition.unit)}\n" if definition.unit else ""
        return f"{unit}{definition.name} ::= {self._type(definition.type, 0)}"

    def _class(self, class_: t.ObjectClass) -> str:
        return (
            f"{class_.name} ::= CLASS {{\n  {class_.id_field} {self._type(class_.id_type, 1)} UNIQUE,\n"
            f"  {class_.type_field}\n}} WITH SYNTAX {{{class_.type_field} IDENTIFIED BY {class_.id_field}}}"
        )

    def _set(self, set_: t.ObjectSet) -> str:
        rows = [f"{{{self._type(row.type, 1)} IDENTIFIED BY {row.value}}}" for row in set_.rows]
        parts = [" |\n  ".join(rows)] if rows else []
        parts += ["..."] if set_.is_extensible else []
        lines = ",\n  ".join(parts)
        return f"{set_.name} {self._name(set_.class_)} ::= {{\n  {lines}\n}}"

    # ---------------------------------------------------------------- types

    def _type(self, type_: t.Type, level: int, is_definition: bool = True) -> str:
        match type_:
            case t.Sequence():
                shape = self._list("SEQUENCE", self._sequence_lines(type_, level, is_definition), level)
            case t.Choice():
                lines = [*self._components(type_.root, level), *self._additions(type_, level)]
                shape = self._list("CHOICE", lines, level)
            case t.SequenceOf():
                return self._sequence_of(type_, level)
            case t.Enumerated():
                shape = _enumerated(type_)
            case t.ClassField():
                shape = f"{self._name(type_.class_)}.{self._class_of(type_).id_field} ({{{self._name(type_.set_)}}})"
            case t.OpenType():
                # @name is looked up in the outermost textually enclosing type, @.name in the innermost (X.682 10.7).
                at = "@" if is_definition else "@."
                field = f"{self._name(type_.class_)}.{self._class_of(type_).type_field}"
                shape = f"{field} ({{{self._name(type_.set_)}}}{{{at}{type_.selector}}})"
            case t.Reference():
                shape = self._name(type_)
            case t.ObjectIdentifier():
                shape = self._object_identifier(type_)
            case _:
                shape = _simple(type_)
        return shape + "".join(f" ({one})" for one in self._constraints(type_))

    def _sequence_of(self, type_: t.SequenceOf, level: int) -> str:
        constraints = self._constraints(type_)
        if len(constraints) > 1:
            raise ValueError(f"a list without a name has {len(constraints)} constraints; ASN.1 can write one")
        inside = "".join(f" ({one})" for one in constraints)
        return f"{'SET' if type_.is_set else 'SEQUENCE'}{inside} OF {self._type(type_.element, level, False)}"

    def _sequence_lines(self, type_: t.Sequence, level: int, is_definition: bool) -> list[str]:
        lines = [*self._components(type_.root, level, is_definition), *self._additions(type_, level)]
        if type_.tail:
            lines += ["...", *self._components(type_.tail, level, is_definition)]
        return lines

    def _components(self, components: Iterable[t.Component], level: int, is_definition: bool = False) -> list[str]:
        return [self._component(one, level + 1, is_definition and level == 0) for one in components]

    def _component(self, component: t.Component, level: int, is_definition: bool = False) -> str:
        unit = f"{_unit(component.unit)}\n{'  ' * level}" if component.unit else ""
        rest = f" DEFAULT {self._default(component)}" if component.default is not None else ""
        rest = " OPTIONAL" if component.is_optional else rest
        return f"{unit}{component.name} {self._type(component.type, level, is_definition)}{rest}"

    def _additions(self, type_: t.Sequence | t.Choice, level: int) -> list[str]:
        lines = ["..."] if type_.is_extensible else []
        for one in type_.additions:
            if isinstance(one, t.Group):
                version = "" if one.version is None else f"{one.version}: "
                inner = f",\n{'  ' * (level + 2)}".join(self._component(member, level + 2) for member in one.components)
                lines.append(f"[[ {version}{inner} ]]")
            else:
                lines.append(self._component(one, level + 1))
        return lines

    @staticmethod
    def _list(word: str, lines: Many[str], level: int) -> str:
        if not lines:
            return f"{word} {{}}"
        indent = "  " * (level + 1)
        return f"{word} {{\n{indent}" + f",\n{indent}".join(lines) + f"\n{'  ' * level}}}"

    def _object_identifier(self, type_: t.ObjectIdentifier) -> str:
        if not type_.is_relative:
            return "OBJECT IDENTIFIER"
        return "OCTET STRING" if self._for == "asn1tools" else "RELATIVE-OID"

    def _default(self, component: t.Component) -> str:
        match component.default:
            case bool(value):
                return "TRUE" if value else "FALSE"
            case int(value):
                return str(value)
            case str(value):
                return _quoted(value) if isinstance(self._base(component.type), t.CharacterString) else value
            case bytes(octets):
                return f"'{octets.hex().upper()}'H"
            case (octets, bits):
                return f"'{int.from_bytes(octets, 'big'):0{8 * len(octets)}b}"[: bits + 1] + "'B"
        raise ValueError(f"{component.name}: no notation for the default {component.default!r}")

    def _base(self, type_: t.Type) -> t.Type:
        while isinstance(type_, t.Reference):
            type_ = self._schema.resolve(type_).type
        return type_

    # ---------------------------------------------------------------- names

    def _name(self, reference: t.Reference) -> str:
        """Return a symbol's name and import it if necessary.

        It is prefixed by its module if another symbol has the same name (X.680 14).
        """
        if reference.module == self._module.key:
            return reference.name
        others = (names for key, names in self._imported.items() if key != reference.module)
        own = (self._module.definitions, self._module.classes, self._module.sets)
        if any(reference.name in names for names in (*others, *own)):
            return f"{self._schema.modules[reference.module].name}.{reference.name}"
        self._imported.setdefault(reference.module, set()).add(reference.name)
        return reference.name

    def _class_of(self, type_: t.ClassField | t.OpenType) -> t.ObjectClass:
        return self._schema.modules[type_.class_.module].classes[type_.class_.name]

    # ---------------------------------------------------------------- constraints

    def _constraints(self, type_: t.Type) -> list[str]:
        seen = (
            type_.constraints
            if self._for != "pycrate"
            else [one for one in type_.constraints if not _is_inner(one.root)]
        )
        return [self._constraint(one) for one in seen]

    def _constraint(self, constraint: t.Constraint, of_characters: bool = False) -> str:
        parts = [self._elements(constraint.root, of_characters)]
        parts += ["..."] if constraint.is_extensible else []
        parts += [self._elements(constraint.additions, of_characters)] if constraint.additions is not None else []
        return ", ".join(parts)

    def _elements(self, elements: t.ElementSet, of_characters: bool = False) -> str:
        match elements:
            case t.Values(ranges):
                return " | ".join(_range(one, of_characters) for one in ranges)
            case t.Size(within):
                return f"SIZE ({self._constraint(within)})"
            case t.Alphabet(within):
                return f"FROM ({self._constraint(within, True)})"
            case t.Element(constraint):
                return f"WITH COMPONENT ({self._constraint(constraint)})"
            case t.Inner():
                lines = (["..."] if elements.partial else []) + [self._inner(one) for one in elements.components]
                return f"WITH COMPONENTS {{{', '.join(lines)}}}"
            case t.Contents(type_):
                return f"CONTAINING {self._type(type_, 0, False)}"
            case t.AnyOf(members):
                return " | ".join(self._part(one, of_characters) for one in members)
            case t.AllOf(members):
                return " ^ ".join(self._part(one, of_characters) for one in members)
            case t.AllExcept(member):
                return f"ALL EXCEPT {self._part(member, of_characters)}"

    def _part(self, elements: t.ElementSet, of_characters: bool) -> str:
        """Return an operand, in parentheses unless it is a single element."""
        is_short = isinstance(elements, t.Size | t.Alphabet) or (
            isinstance(elements, t.Values) and len(elements.ranges) == 1
        )
        return self._elements(elements, of_characters) if is_short else f"({self._elements(elements, of_characters)})"

    def _inner(self, component: t.InnerComponent) -> str:
        constraint = f" ({self._constraint(component.constraint)})" if component.constraint is not None else ""
        return f"{component.name}{constraint}{f' {component.presence}' if component.presence else ''}"


def _is_inner(elements: t.ElementSet) -> bool:
    match elements:
        case t.Inner() | t.Element():
            return True
        case t.AnyOf(members) | t.AllOf(members):
            return any(map(_is_inner, members))
        case t.AllExcept(member):
            return _is_inner(member)
    return False


def _title(module: t.Module) -> str:
    return f"{module.name} {module.oid}".rstrip()


def _unit(unit: str) -> str:
    return f"/** @unit: {unit} */"


def _simple(type_: t.Type) -> str:
    match type_:
        case t.Boolean():
            return "BOOLEAN"
        case t.Null():
            return "NULL"
        case t.Integer():
            return f"INTEGER{_names(type_.names)}"
        case t.BitString():
            return f"BIT STRING{_names(type_.names)}"
        case t.OctetString():
            return "OCTET STRING"
        case t.CharacterString():
            return type_.kind
    raise TypeError(type_)


def _names(names: Many[t.Named]) -> str:
    return f" {{{', '.join(f'{one.name}({one.value})' for one in names)}}}" if names else ""


def _enumerated(type_: t.Enumerated) -> str:
    items = [f"{one.name}({one.value})" for one in type_.root]
    items += ["..."] if type_.is_extensible else []
    items += [f"{one.name}({one.value})" for one in type_.additions]
    return f"ENUMERATED {{{', '.join(items)}}}"


def _range(range_: t.Range, of_characters: bool) -> str:
    low = "MIN" if range_.low is None else _character(range_.low) if of_characters else str(range_.low)
    high = "MAX" if range_.high is None else _character(range_.high) if of_characters else str(range_.high)
    return low if low == high else f"{low}..{high}"


def _character(code: int) -> str:
    """Return a character in quotes; others than printable ASCII as tuple or quadruple (X.680 41.9, 41.10)."""
    if 0x20 <= code < 0x7F:
        return _quoted(chr(code))
    column_row = f"{{{code >> 4}, {code & 15}}}"
    return column_row if code < 0x80 else f"{{{code >> 24}, {code >> 16 & 255}, {code >> 8 & 255}, {code & 255}}}"


def _quoted(characters: str) -> str:
    return '"' + characters.replace('"', '""') + '"'
