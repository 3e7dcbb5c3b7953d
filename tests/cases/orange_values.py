"""Values of the message library by the tables of a type: bounds, options and alternatives by chance, each seed the same."""

import random
from typing import Any

MOST_ITEMS = 2  # beyond the least


class Values:
    """A source of values.

    has_extensions  with integers and items beyond the root of their type.
    """

    def __init__(self, seed: str, has_extensions: bool) -> None:
        self._random = random.Random(seed)
        self._has_extensions = has_extensions

    def value(self, kind: Any, depth: int = 0) -> Any:
        match kind.kind:
            case "INTEGER":
                return self._integer(kind)
            case "BOOLEAN":
                return self._random.random() < 0.5
            case "ENUMERATED":
                return self._random.choice(kind.names)[0]
            case "SEQUENCE":
                return self._sequence(kind, depth)
            case "SEQUENCE OF":
                return [self.value(kind.element, depth + 1) for _ in range(self._size(kind))]
            case "CHOICE":
                field = self._random.choice([one for one in kind.fields if depth < 12 or one.type.kind != "CHOICE"])
                return field.name, self.value(field.type, depth + 1)
            case "BIT STRING":
                size = self._random.randint(kind.low or 0, kind.high or 8)
                named = {at for name, at in kind.names if name != "reserved1"} or set(range(size))
                bits = [at in named and self._random.random() < 0.5 for at in range(size)]
                octets = bytearray(-(-size // 8))
                for at, is_set in enumerate(bits):
                    octets[at // 8] |= is_set << (7 - at % 8)
                return bytes(octets), size
            case "OCTET STRING":
                return self._random.randbytes(self._size(kind))
            case "NULL":
                return None
        return "".join(self._random.choice("0123") for _ in range(self._size(kind)))

    def _integer(self, kind: Any) -> int:
        low, high = kind.low if kind.low is not None else 0, kind.high if kind.high is not None else 100
        if self._has_extensions and kind.is_extensible and self._random.random() < 0.1:
            return int(high) + 5000
        return int(self._random.choice((low, high, self._random.randint(low, high))))

    def _size(self, kind: Any) -> int:
        low = kind.low or 0
        most = low + MOST_ITEMS if kind.high is None else kind.high
        return int(self._random.randint(low, min(most, low + MOST_ITEMS)))

    def _sequence(self, kind: Any, depth: int) -> dict[str, Any]:
        found: dict[str, Any] = {}
        row: Any = None
        for field in kind.fields:
            if field.type.kind == "open type" and field.type.rows:
                number, row = self._random.choice(field.type.rows)
                found[kind.fields[0].name] = number
                found[field.name] = self.value(row, depth + 1)
            elif field.type.kind == "open type":
                found[field.name] = b"\x00"
            elif not field.is_optional or self._random.random() < self._chance(field, depth):
                found[field.name] = self.value(field.type, depth + 1)
        return found

    def _chance(self, field: Any, depth: int) -> float:
        return 0.05 if field.name == "regional" else 0.6 if depth < 6 else 0.2


def pdus(message: Any, count: int, seed: str, has_extensions: bool = False) -> list[bytes]:
    """Messages of an edition that it encodes."""
    source, found = Values(f"{message.name} {seed}", has_extensions), []
    tree = message.type_tree()
    for _ in range(count):
        value = source.value(tree)
        names = [one.name for one in tree.fields[0].type.fields]
        value["header"] |= {names[0]: message.versions[-1], names[1]: message.ids[0]}
        try:
            pdu = message.encode(value)
        except ValueError:  # a constraint between values
            continue
        if len(pdu) <= 1400:
            found.append(pdu)
    return found
