"""JSON schemas of Orange's its-client, and values that follow them.

orange/ has the facts of schema/ (github.com/Orange-OpenSource/its-client, MIT, Copyright 2016-2022 Orange; of
2026-07): members, types and bounds, without its texts. They refer to a file of dsrc 1.0.0 that is not there; 2.0.0
replaces it.
"""

import json
import random
from functools import cache
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT202012

HERE = Path(__file__).parent
FOLDER = HERE / "orange"
DSRC = "dsrc_schema_2-0-0.json"
LIBRARIES = frozenset({DSRC})  # definitions for others

Schema = dict[str, Any]


def files() -> list[str]:
    """The schemas of messages, by file name."""
    return sorted(path.name for path in FOLDER.glob("*.json") if path.name not in LIBRARIES)


@cache
def schema(name: str) -> Any:
    return json.loads((FOLDER / name).read_text())


def _retrieve(uri: str) -> Resource[Any]:
    name = uri.rsplit("/", 1)[-1]
    return Resource.from_contents(schema(DSRC if name.startswith("dsrc") else name), DRAFT202012)


REGISTRY: Registry[Any] = Registry(retrieve=_retrieve)


@cache
def validator(name: str) -> Draft202012Validator:
    return Draft202012Validator(schema(name), registry=REGISTRY)


def file_of(kind: str, version: str) -> str:
    return f"{kind}_schema_{version.replace('.', '-')}.json"


def check(kind: str, envelope: dict[str, Any]) -> None:
    """Raises ValidationError where it is not what the schema that its version names says."""
    validator(file_of(kind, envelope["version"])).validate(envelope)


class Generator:
    """Values that follow a schema, each seed the same: optional members by chance, bounds more often than others."""

    def __init__(self, name: str, seed: int) -> None:
        self._root = schema(name)
        self._random = random.Random(f"{name} {seed}")

    def value(self) -> Any:
        return self._value(self._root, self._root, 0)

    def _value(self, part: Schema, root: Schema, depth: int) -> Any:
        if "$ref" in part:
            file, _, path = part["$ref"].partition("#/")
            root = schema(DSRC) if file else root
            found: Any = root
            for step in path.split("/"):
                found = found[step]
            return self._value(found, root, depth)
        if "const" in part:
            return part["const"]
        if "enum" in part:
            return self._random.choice(part["enum"])
        options = part.get("oneOf") or part.get("anyOf") or []
        if options and "properties" not in part and part.get("type") != "object":
            return self._value(self._random.choice(options), root, depth)
        match part.get("type", "object" if "properties" in part else "integer"):
            case "object":
                return self._object(part, options, root, depth)
            case "array":
                return self._array(part, root, depth)
            case "string":
                return self._text(part)
            case "boolean":
                return self._random.random() < 0.5
            case "number":
                return self._random.uniform(-90, 90)
            case _:
                return self._integer(part)

    def _object(self, part: Schema, options: list[Schema], root: Schema, depth: int) -> dict[str, Any]:
        option = self._random.choice(options) if options else {}
        members = {**part.get("properties", {}), **option.get("properties", {})}
        required = {*part.get("required", []), *option.get("required", [])}
        others = {name for one in options if one is not option for name in one.get("required", [])} - required
        for name in required - set(members):  # cam 2.2.0 has two blanks behind a name that it requires
            members[name] = next((members.pop(one) for one in list(members) if one.strip() == name), {})
        chance = 0.6 if depth < 8 else 0.2
        return {
            name: self._value(member, root, depth + 1)
            for name, member in members.items()
            if name in required or (name not in others and self._random.random() < chance)
        }

    def _array(self, part: Schema, root: Schema, depth: int) -> list[Any]:
        least, most = part.get("minItems", 0), part.get("maxItems", 4)
        count = self._random.choice((least, min(most, least + 1), min(most, least + 2)))
        return [self._value(part.get("items") or part.get("item") or {}, root, depth + 1) for _ in range(count)]

    def _text(self, part: Schema) -> str:
        size = self._random.randint(part.get("minLength", 1), part.get("maxLength", 12))
        letters = "01" if part.get("minLength") == part.get("maxLength") else "ab 01Z"
        return "".join(self._random.choice(letters) for _ in range(size))

    def _integer(self, part: Schema) -> int:
        low, high = part.get("minimum", -5), part.get("maximum", 1000)
        return self._random.choice((low, high, self._random.randint(low, high)))


def sample(name: str, seed: int) -> dict[str, Any]:
    """A message that follows a schema, with a protocol_version and a message_format that fit it."""
    found: dict[str, Any] = Generator(name, seed).value()
    message = found.get("message")
    if isinstance(message, dict):
        if "protocol_version" in message:
            message["protocol_version"] = 2 if name.startswith("cpm_schema_2-1") else 1 + seed % 2
        if "message_format" in found:
            found["message_format"] = "asn1/uper" if "payload" in message else "json/raw"
    return found


def disturb(message: dict[str, Any], seed: int) -> None:
    """Put a value of another kind somewhere into a message."""
    source = random.Random(seed)
    holder: Any = message
    for _ in range(source.randint(1, 5)):
        inner = [
            item
            for item in (holder.values() if isinstance(holder, dict) else holder)
            if isinstance(item, dict | list) and item
        ]
        if not inner:
            break
        holder = source.choice(inner)
    at = source.choice(list(holder)) if isinstance(holder, dict) else source.randrange(len(holder))
    holder[at] = source.choice((None, True, -1, 1 << 70, 2.5, "x", "\ud800", [], {}, [[]], {"value": {}}, [None]))
