"""Decoded messages as messages of ROS 2: type definitions and CDR, for recordings.

The message library contains the names and the layout of fields as data (asn1/backends/ros2/plan.py), including the
types of etsi_its_messages. This code takes 0.2 ms for a CAM: ten times as long as the compiled code of the gateway.
"""

import json
import struct
import zlib
from collections.abc import Callable, Sequence
from typing import Any

# Header of each message: XCDR1, little endian.
ENCAPSULATION = b"\0\1\0\0"
RULE = "=" * 80  # line between definitions, as `ros2 bag` writes it
NUMBERS = {
    "bool": "B", "uint8": "B", "int8": "b", "uint16": "H", "int16": "h", "uint32": "I", "int32": "i", "uint64": "Q",
    "int64": "q",
}  # fmt: skip

Cdr = Callable[[object], bytes]
Step = Callable[[Any], Any]
Write = Callable[[bytearray, Any], None]


class Absent:
    """Value of an absent part of a message; all its fields are written as zero."""


ABSENT = Absent()


class Types:
    """Message types of a plan, which `captain_messages.ros2_plan()` returns; by edition.

    The methods raise KeyError for an edition that the plan does not contain.
    """

    def __init__(self, plan: bytes) -> None:
        document = json.loads(zlib.decompress(plan))
        self._types: list[Any] = document["types"]
        self._tops: dict[str, Any] = document["tops"]
        self._writers: dict[int, Write] = {}

    def __contains__(self, edition: str) -> bool:
        return edition in self._tops

    def name(self, edition: str) -> str:
        """Return the full name of a type, for example etsi_its_cam_msgs/msg/CAM."""
        package, number, _ = self._tops[edition]
        return f"{package}/msg/{self._types[number][0]}"

    def hash(self, edition: str) -> str:
        """Return the hash of a type (RIHS01_...), by which two ROS nodes check that their types are equal."""
        return str(self._tops[edition][2])

    def definition(self, edition: str) -> str:
        """Return the .msg text of a type and of all types inside it (schema encoding ros2msg)."""
        package, top, _ = self._tops[edition]
        numbers = self._held(top)
        heads = ["", *(f"{RULE}\nMSG: {package}/{self._types[number][0]}\n" for number in numbers[1:])]
        return "".join(head + self._text(number) for head, number in zip(heads, numbers, strict=True))

    def writer(self, edition: str) -> Cdr:
        """Return a function that encodes a decoded message as CDR, including the encapsulation header."""
        write = self._writer(self._tops[edition][1])

        def cdr(value: object) -> bytes:
            out = bytearray()
            write(out, value)
            return ENCAPSULATION + out

        return cdr

    def _held(self, top: int) -> list[int]:
        found = [top]
        for number in found:  # the list grows during the loop
            parts = (_number_of(field[0]) for field in self._types[number][1])
            found += [part for part in dict.fromkeys(parts) if part is not None and part not in found]
        return found

    def _text(self, number: int) -> str:
        lines = []
        for type_, name, _, _, _, constants in self._types[number][1]:
            part = _number_of(type_)
            word = type_ if part is None else self._types[part][0] + ("[]" if isinstance(type_, list) else "")
            lines += [f"{word} {name}", *constants.splitlines()]
        return "".join(f"{line}\n" for line in lines)

    # -- writers of values, one for each field

    def _writer(self, number: int) -> Write:
        """Return the writer of a message type. It is cached, because several types contain the same one."""
        if number not in self._writers:
            fields = [self._field(*field) for field in self._types[number][1]] or [_nothing]

            def write(out: bytearray, value: Any) -> None:
                for field in fields:
                    field(out, value)

            self._writers[number] = write
        return self._writers[number]

    def _field(
        self, type_: Any, _name: str, role: str, source: list[Any], numbers: dict[str, int] | None, _constants: str
    ) -> Write:
        steps = [_step(step) for step in source]
        match role:
            case "p":
                write = _is_there(source)
            case "c":
                write = _choice(type_, numbers or {})
            case "b":
                write = _bits_unused
            case _:
                write = self._value(type_, numbers)

        def field(out: bytearray, value: Any) -> None:
            for step in steps:
                value = step(value)
            write(out, value)

        return field

    def _value(self, type_: Any, numbers: dict[str, int] | None) -> Write:
        if isinstance(type_, int):
            return self._writer(type_)
        if isinstance(type_, list):
            return _list(self._writer(type_[0]))
        if type_ == "uint8[]":
            return _octets
        base = type_.removesuffix("[]")
        one = _string if base == "string" else _number(base, numbers)
        return one if base == type_ else _list(one)


def _number_of(type_: object) -> int | None:
    """Return the number of the message type that a field contains; None for other fields."""
    inner = type_[0] if isinstance(type_, list) else type_
    return inner if isinstance(inner, int) else None


def _step(step: Any) -> Step:
    """Return a function for one step from a decoded value to a part of it.

    The part is a component of a SEQUENCE, an alternative of a CHOICE or an open type; ABSENT if it is missing.
    """
    name, default, selector = (*step, None)[:3] if isinstance(step, list) else (step, ABSENT, None)
    if selector is not None:
        return lambda value: value[name] if type(value) is dict and value[selector] == default else ABSENT

    def go(value: Any) -> Any:
        if type(value) is dict:
            return value.get(name, default)
        return value[1] if type(value) is tuple and value[0] == name else ABSENT

    return go


# -- writers of single values; CDR aligns each number to its size


def _number(base: str, numbers: dict[str, int] | None) -> Write:
    """Return a writer of numbers of this type.

    An unknown item of an enumeration is written as the highest number, a number out of range as the nearest valid one.
    """
    packed = struct.Struct(f"<{NUMBERS[base]}")
    low, high = _limits(base)

    def write(out: bytearray, value: Any) -> None:
        if value is ABSENT:
            value = 0
        elif numbers is not None:
            value = numbers.get(value, high)
        out += bytes(-len(out) % packed.size)
        out += packed.pack(min(max(value, low), high))

    return write


def _limits(base: str) -> tuple[int, int]:
    bits = struct.calcsize(f"<{NUMBERS[base]}") * 8
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if base.startswith("int") else (0, (1 << bits) - 1)


def _choice(base: str, numbers: dict[str, int]) -> Write:
    write = _number(base, numbers)
    return lambda out, value: write(out, value if value is ABSENT else value[0])


def _is_there(source: Sequence[Any]) -> Write:
    """Return the writer of a presence flag. A component that equals its DEFAULT counts as absent."""
    default = source[-1][1] if isinstance(source[-1], list) and len(source[-1]) == 2 else ABSENT
    return lambda out, value: out.append(value is not ABSENT and value != default)


def _bits_unused(out: bytearray, value: Any) -> None:
    out.append(0 if value is ABSENT else -value[1] % 8)


def _nothing(out: bytearray, _: Any) -> None:
    """Write the one octet that rosidl generates for a message without fields."""
    out.append(0)


def _count(out: bytearray, count: int) -> None:
    out += bytes(-len(out) % 4)
    out += count.to_bytes(4, "little")


def _octets(out: bytearray, value: Any) -> None:
    """Write the octets of an OCTET STRING or BIT STRING."""
    octets = b"" if value is ABSENT else value[0] if isinstance(value, tuple) else bytes(value)
    _count(out, len(octets))
    out += octets


def _string(out: bytearray, value: Any) -> None:
    octets = b"" if value is ABSENT else value.encode()
    _count(out, len(octets) + 1)
    out += octets + b"\0"


def _list(element: Write) -> Write:
    def write(out: bytearray, value: Any) -> None:
        elements = () if value is ABSENT else value
        _count(out, len(elements))
        for one in elements:
            element(out, one)

    return write
