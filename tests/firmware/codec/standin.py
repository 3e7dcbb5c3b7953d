"""A message library of two octets' worth of rules, for what the real one cannot be brought to do at will.

A message is the ITS PDU header (protocolVersion, messageID, stationID) and numbers of one octet each, which have names
and highest values. A library has editions that differ in these.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

HEADER = 6


class DecodeError(ValueError):
    def __init__(self, path: str, bit: int, reason: str) -> None:
        super().__init__(f"{path}: bit {bit}: {reason}")
        self.path, self.bit, self.reason = path, bit, reason


class EncodeError(ValueError):
    def __init__(self, path: str, reason: str) -> None:
        super().__init__(f"{path}: {reason}")
        self.path, self.reason = path, reason


class Step(NamedTuple):
    what: str
    bit: int
    width: int
    path: str
    type: str = ""
    text: str = ""
    unit: str = ""
    clause: str = ""


@dataclass(frozen=True)
class Message:
    """fields: name -> highest value. mask: bits of each field that survive encoding. strict: what validate() allows."""

    name: str
    ids: tuple[int, ...]
    versions: tuple[int, ...]
    fields: dict[str, int]
    rank: int = 1
    btp_port: int = 2001
    release: int = 1
    standard: str = "a standard"
    is_experimental: bool = False
    mask: int = 0xFF
    strict: int = 0xFF
    offset: int = 0
    unknown: int = 0
    form_of: str = ""

    @property
    def type(self) -> str:
        return self.name.partition("-")[0]

    def decode(self, octets: bytes) -> dict[str, object]:
        names = list(self.fields)
        for at, name in enumerate(names, HEADER):
            if at >= len(octets):
                raise DecodeError(f"body.{name}", 8 * at, "truncated")
            if octets[at] > self.fields[name]:
                raise DecodeError(
                    f"body.{name}", 8 * at, f"out of range: {octets[at]} is not in 0..{self.fields[name]}"
                )
        end = HEADER + len(names)
        if len(octets) != end:
            raise DecodeError("", 8 * end, f"{len(octets) - end} octets follow")
        header = {"protocolVersion": octets[0], "messageID": octets[1], "stationID": int.from_bytes(octets[2:6])}
        return {"header": header, "body": dict(zip(names, octets[HEADER:], strict=True))}

    view = decode

    def encode(self, value: object) -> bytes:
        assert isinstance(value, dict)
        head, body = value["header"], value["body"]
        for name, number in body.items():
            if not 0 <= number <= self.fields[name]:
                raise EncodeError(f"body.{name}", f"out of range: {number} is not in 0..{self.fields[name]}")
        octets = bytes((head["protocolVersion"], head["messageID"])) + head["stationID"].to_bytes(4)
        return octets + bytes(body[name] & self.mask for name in self.fields)

    def to_json(self, octets: bytes, /, *, plain: bool = False) -> str:
        return json.dumps(self.decode(octets))

    def from_json(self, text: str, /, *, plain: bool = False) -> bytes:
        return self.encode(json.loads(text))

    def leaves(self, octets: bytes) -> tuple[bytes, int]:
        """offset: added to each number, as in an edition that counts from another value."""
        return bytes((octet + self.offset) % 256 for octet in octets[HEADER:]), self.unknown

    def validate(self, value: object) -> None:
        assert isinstance(value, bytes)
        if any(octet > self.strict for octet in value[HEADER:]):
            raise ValueError("it breaks a constraint")

    def text(self, octets: bytes) -> str:
        value = self.decode(octets)
        return "\n".join(f"{part}\n" + "\n".join(f"  {k}: {v}" for k, v in value[part].items()) for part in value)

    def explain(self, octets: bytes) -> Sequence[Step]:
        steps = [Step("enter", 8 * HEADER, 0, "body", "Body")]
        for at, (name, octet) in enumerate(zip(self.fields, octets[HEADER:], strict=False), HEADER):
            steps.append(Step("value", 8 * at, 8, f"body.{name}", "Octet", f"{octet} m", "m", "11.5.7.2"))
        return [*steps, Step("leave", 8 * len(octets), 0, "body")]

    def type_tree(self) -> "Type":
        header = Type(tuple(map(Field, ("protocolVersion", "messageID", "stationID"))))
        return Type((Field("header", header), Field("body", Type(tuple(map(Field, self.fields))))))


class Type(NamedTuple):
    fields: tuple["Field", ...] = ()
    element: "Type | None" = None
    rows: tuple[tuple[int, "Type"], ...] = ()


class Field(NamedTuple):
    name: str
    type: Type = Type()


class Library:
    def __init__(self, *messages: Message) -> None:
        self._messages = messages

    def all(self) -> Sequence[Message]:
        return self._messages

    def find(self, name: str) -> Message:
        fits = [message for message in self._messages if name in (message.name, message.type)]
        return min(fits, key=lambda message: message.rank)


OLD = Message("ball-1.1", ids=(66,), versions=(1, 2), fields={"size": 100}, rank=2, btp_port=3001)
NEW = Message("ball-2.1", ids=(66,), versions=(2,), fields={"size": 50, "colour": 7}, rank=1, release=2, btp_port=3001)
SAME = Message("ball-1.2", ids=(66,), versions=(2,), fields={"size": 200}, rank=1, btp_port=3001)
DOOR = Message("door-1.1", ids=(67,), versions=(2,), fields={"width": 9, "height": 9, "depth": 9}, btp_port=3002)
BARE = Message("bare-1", ids=(), versions=(), fields={"a": 255, "b": 255}, btp_port=0, strict=3)


def octets(message: Message, *body: int, version: int | None = None, number: int | None = None) -> bytes:
    """A message of station 1337."""
    head = bytes((message.versions[0] if version is None else version, message.ids[0] if number is None else number))
    return head + (1337).to_bytes(4) + bytes(body)
