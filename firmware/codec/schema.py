"""JSON schema (draft 2020-12) of a message, generated from the tables of the message library."""

import json
from collections.abc import Iterable, Mapping

from drivers.wire.type_tree import Type
from firmware.codec.library import Message

DRAFT = "https://json-schema.org/draft/2020-12/schema"

Schema = dict[str, object]

_OCTETS = "(?:[0-9A-Fa-f]{2})"
_HEX: Schema = {"type": "string", "pattern": f"^{_OCTETS}*$"}
_UNKNOWN: Schema = {"type": "string", "pattern": "^\\[[0-9]+\\]$"}  # item or bit without a name: "[2]"
_ADDITION = "^\\[[0-9]+\\]$"
_MAX_ADDITIONS = 16383
_TEXTS = {
    "IA5String": "^[\\x00-\\x7f]*$",
    "VisibleString": "^[ -~]*$",
    "PrintableString": "^[A-Za-z0-9 '()+,./:=?-]*$",
    "NumericString": "^[0-9 ]*$",
}
_INT64 = {"minimum": -(2**63), "maximum": 2**63 - 1}  # the library has no larger extensible or unbounded numbers
_ANY = {"minimum": -1e27, "maximum": 1e27}  # the same in any unit
_MAX_BITS = 2**32 - 1
# Kinds of open types whose values are text, so that hexadecimal text would be ambiguous.
_NOT_RAW = ("ENUMERATED", "BIT STRING", "OCTET STRING", *_TEXTS, "UTF8String", "OBJECT IDENTIFIER", "RELATIVE-OID")


def schema(message: Message, is_plain: bool) -> Schema:
    """Return the schema of the objects that `captain encode` reads for one edition."""
    definitions = _Definitions(is_plain)
    inner = definitions.reference(message.type_tree(), None)
    form = {"const": "plain" if is_plain else "json"}
    return {
        "$schema": DRAFT,
        "title": f"{message.name}, {message.standard}, {'plain' if is_plain else 'exact'} dialect",
        "type": "object",
        "properties": {"edition": {"const": message.name}, "form": form, "message": inner},
        "required": ["edition", "message"],
        "$defs": definitions.known,
    }


class _Definitions:
    """Schemas of named types, each written once; types may contain themselves.

    known  schemas by name, for $defs.
    """

    def __init__(self, is_plain: bool) -> None:
        self.known: dict[str, Schema] = {}
        self._is_plain = is_plain
        self._names: dict[tuple[Type, str | None], str] = {}

    def reference(self, type_: Type, unit: str | None) -> Schema:
        """Return the schema of a type, as a reference if the type has a name."""
        if type_.name is None:
            return self._schema(type_, unit)
        key = type_, unit
        if key not in self._names:
            name = self._names[key] = self._free(type_.name)
            self.known[name] = {}
            self.known[name] = self._schema(type_, unit)
        return {"$ref": f"#/$defs/{self._names[key]}"}

    def _free(self, name: str) -> str:
        """Return a name for $defs: modules may have different types of one name."""
        count = sum(one.partition(".")[0] == name for one in self.known)
        return f"{name}.{count + 1}" if count else name

    def _schema(self, type_: Type, unit: str | None) -> Schema:
        match type_.kind:
            case "BOOLEAN":
                return {"type": "boolean"}
            case "NULL":
                return {"type": "null"}
            case "INTEGER":
                return self._number(type_, unit or type_.unit)
            case "ENUMERATED":
                return _or_unknown({"enum": [name for name, _ in type_.names]}, type_)
            case "BIT STRING":
                return self._bits(type_)
            case "SEQUENCE":
                return self._sequence(type_)
            case "CHOICE":
                return self._choice(type_)
            case "SEQUENCE OF":
                assert type_.element is not None
                items = self.reference(type_.element, None)
                return {"type": "array", "items": items, **_size(type_, "minItems", "maxItems")}
            case "open type":
                raw = [] if any(self._may_be_text(row) for _, row in type_.rows) else [_HEX]
                return _any([*(self.reference(row, None) for _, row in type_.rows), *raw])
            case _:
                return _text(type_)

    def _may_be_text(self, type_: Type) -> bool:
        return type_.kind in _NOT_RAW or (self._is_plain and bool(type_.special))

    def _number(self, type_: Type, unit: str | None) -> Schema:
        if not self._is_plain or unit is None:
            number: Schema = {"type": "integer", **(_INT64 | _size(type_, "minimum", "maximum"))}
        else:
            low, high, unit = type_.plain_range(unit)
            ends = {"minimum": low, "maximum": high}
            known = {key: json.loads(end) for key, end in ends.items() if end is not None}
            number = {"type": "number", **(_ANY | known)}
        if unit:
            number["description"] = f"in {unit}"
        if not self._is_plain or not type_.special:
            return number
        return {"anyOf": [number, {"enum": list(type_.special)}]}

    def _bits(self, type_: Type) -> Schema:
        if self._is_plain and type_.names:
            one = {"anyOf": [{"enum": [name for name, _ in type_.names]}, _UNKNOWN]}
            return {"type": "array", "items": one, "uniqueItems": True}
        if type_.low is not None and type_.low == type_.high and not type_.is_extensible:
            return {"type": "string", "pattern": f"^{_OCTETS}{{{(type_.low + 7) // 8}}}$"}
        length: Schema = {"type": "integer", "minimum": 0, "maximum": _MAX_BITS}
        if not type_.names:  # named bits may end before the lower bound
            length |= _size(type_, "minimum", "maximum")
        return _object({"value": _HEX, "length": length}, ["value", "length"])

    def _sequence(self, type_: Type) -> Schema:
        properties = {field.name: self.reference(field.type, field.unit) for field in type_.fields}
        if type_.is_extensible:
            properties["[]"] = {"type": "integer", "minimum": 1, "maximum": _MAX_ADDITIONS}
        made = _object(properties, [field.name for field in type_.fields if not field.is_optional])
        return made | {"patternProperties": {_ADDITION: _HEX}} if type_.is_extensible else made

    def _choice(self, type_: Type) -> Schema:
        made = _object({field.name: self.reference(field.type, field.unit) for field in type_.fields}, [])
        made |= {"minProperties": 1, "maxProperties": 1}
        return made | {"patternProperties": {_ADDITION: _HEX}} if type_.is_extensible else made


def _object(properties: Mapping[str, Schema], required: list[str]) -> Schema:
    made: Schema = {"type": "object", "properties": dict(properties), "additionalProperties": False}
    return made | {"required": required} if required else made


def _any(schemas: Iterable[Schema]) -> Schema:
    """Return a schema that accepts what one of them accepts; each of them once."""
    different = list({json.dumps(one): one for one in schemas}.values())
    return {"anyOf": different}


def _or_unknown(known: Schema, type_: Type) -> Schema:
    return _any([known, _UNKNOWN]) if type_.is_extensible else known


def _size(type_: Type, low: str, high: str) -> Schema:
    """Return the bounds of a number or size; none for an extensible type, because newer senders may exceed them."""
    if type_.is_extensible:
        return {}
    return {key: end for key, end in ((low, type_.low), (high, type_.high)) if end is not None}


def _text(type_: Type) -> Schema:
    if type_.kind == "OCTET STRING":
        size = _size(type_, "low", "high")
        count = f"{{{size.get('low', 0)},{size.get('high', '')}}}" if size else "*"
        return {"type": "string", "pattern": f"^{_OCTETS}{count}$"}
    if type_.kind not in _TEXTS:  # PER ignores the size of a UTF8String
        return {"type": "string"}
    return {"type": "string", "pattern": _TEXTS[type_.kind], **_size(type_, "minLength", "maxLength")}
