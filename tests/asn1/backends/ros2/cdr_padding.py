"""Padding octets of CDR, which some writers leave uninitialised (Fast CDR)."""

from asn1.backends.ros2.model import RosField, RosPackage

SIZES = {
    "bool": 1, "uint8": 1, "int8": 1, "uint16": 2, "int16": 2, "uint32": 4, "int32": 4, "uint64": 8, "int64": 8,
}  # fmt: skip
ENCAPSULATION = 4


def filled(package: RosPackage, message: str, cdr: bytes, octet: int = 0xA5) -> bytes:
    """A CDR of a message with this octet wherever nothing is said."""
    walk = _Walk(package, cdr[ENCAPSULATION:])
    walk.message(message)
    if walk.at != len(walk.octets):
        raise ValueError(f"the message ends at {walk.at} of {len(walk.octets)}")
    body = bytearray(walk.octets)
    for at in walk.between:
        body[at] = octet
    return cdr[:ENCAPSULATION] + bytes(body)


class _Walk:
    def __init__(self, package: RosPackage, octets: bytes) -> None:
        self.package, self.octets, self.at = package, octets, 0
        self.between: list[int] = []

    def message(self, name: str) -> None:
        fields = self.package.messages[name].fields
        for field in fields:
            self.field(field)
        if not fields:
            self.one("uint8")

    def field(self, field: RosField) -> None:
        for _ in range(self.number(4) if field.is_array else 1):
            self.one(field.type)

    def one(self, type_: str) -> None:
        if type_ == "string":
            count = self.number(4)
            self.at += count
        elif type_ in SIZES:
            self.number(SIZES[type_])
        else:
            self.message(type_)

    def number(self, size: int) -> int:
        begin = -(-self.at // size) * size
        self.between += range(self.at, begin)
        self.at = begin + size
        return int.from_bytes(self.octets[begin : self.at], "little")
