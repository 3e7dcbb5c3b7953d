"""A message library for tests: that of build/codec, and a CDR of its own kind: the encapsulation, then the octets."""

from types import ModuleType, SimpleNamespace
from typing import Any

import captain_messages

HEAD = b"\0\1\0\0"


class CdrError(ValueError):
    path = ""
    octet = 0
    reason = ""


class Message:
    """A message of the library that travels as itself."""

    def __init__(self, message: Any) -> None:
        self._message = message

    def __getattr__(self, name: str) -> Any:
        return getattr(self._message, name)

    def ros2_type(self, profile: str) -> str:
        if profile != "etsi_its":
            raise LookupError(f"no ROS 2 message for {self.name} in the profile {profile}")
        return f"{self.type}_msgs/msg/{self.pdu}"

    def to_cdr(self, pdu: bytes, profile: str) -> tuple[bytes, tuple[SimpleNamespace, ...]]:
        self._message.view(pdu)
        return HEAD + pdu, ()

    def from_cdr(self, cdr: bytes, profile: str, original: bytes | None = None) -> bytes:
        if cdr[:4] != HEAD:
            error = CdrError("octet 0: encapsulation")
            error.reason = "encapsulation"
            raise error
        if original is not None and HEAD + original == cdr:
            return original
        try:
            self._message.view(cdr[4:])
        except ValueError as wrong:
            error = CdrError(f"{wrong.path}: octet 4: {wrong.reason}")  # type: ignore[attr-defined]
            error.path, error.reason = "cam.x", "out of range: 95 is not in 0..90"
            raise error from wrong
        return cdr[4:]


class Partial(Message):
    """Its first octet of the body has no field: gone on the way to ROS, and 0 on the way back."""

    def to_cdr(self, pdu: bytes, profile: str) -> tuple[bytes, tuple[SimpleNamespace, ...]]:
        return HEAD + pdu[:6] + pdu[7:], (SimpleNamespace(path="cam.[3]", octets=pdu[6:7]),)

    def from_cdr(self, cdr: bytes, profile: str, original: bytes | None = None) -> bytes:
        if original is not None and cdr == self.to_cdr(original, profile)[0]:
            return original
        return cdr[4:10] + b"\0" + cdr[10:]


class Library(ModuleType):
    def __init__(self, kind: type[Message] = Message) -> None:
        super().__init__("captain_messages")
        self.CdrError = CdrError
        self._kind = kind

    def find(self, name: str) -> Message:
        return self._kind(captain_messages.find(name))

    def all(self) -> tuple[Message, ...]:
        return tuple(self._kind(message) for message in captain_messages.all())
