"""Payloads that hold the PDU's octets as they are, or as base64."""

import binascii

from board.errors import ConfigurationError
from drivers.reason import Reason
from drivers.wire.v2n_message import RefusedError, Sending, source_of


class Binary:
    """The PDU."""

    def write(self, sending: Sending) -> bytes:
        return sending.pdu

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        return payload, ""


class Base64:
    """The PDU as base64 of RFC 4648, section 4."""

    def write(self, sending: Sending) -> bytes:
        return binascii.b2a_base64(sending.pdu, newline=False)

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        return from_base64(payload, "the payload"), ""


class VCaptain:
    """`vm(2001): <AgIAAAU5AAECAw==>`: who, the BTP port, and the PDU as base64 in angle brackets.

    host  the station's own; what it sent itself is refused.
    """

    def __init__(self, host: str) -> None:
        if not host or not host.isprintable() or set(host) & set("<>("):
            raise ConfigurationError(
                f"host {host!r} cannot stand in a payload", "leave ( < > and control characters out"
            )
        self._host = host.encode()

    def write(self, sending: Sending) -> bytes:
        coded = binascii.b2a_base64(sending.pdu, newline=False)
        return b"%s(%d): <%s>" % (self._host, sending.btp_port, coded)

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        """The text between the first `<` and the first `>` after it; in front of it anything may stand."""
        front, opening, rest = payload.partition(b"<")
        coded, closing, _ = rest.partition(b">")
        if not opening or not closing:
            missing = ">" if opening else "<"
            raise RefusedError(Reason.PAYLOAD, f"the payload has no {missing}: {payload[:32]!r}")
        if front.startswith(self._host + b"("):
            raise RefusedError(Reason.OWN_ECHO, f"it is of this station: {front[:64]!r}")
        return from_base64(coded, "what is in brackets"), _sender(front)


def from_base64(text: bytes, what: str) -> bytes:
    """Strict: no white space, no other alphabet, padded, and no bits left over. Raises RefusedError."""
    try:
        octets = binascii.a2b_base64(text, strict_mode=True)
    except binascii.Error as error:
        why = str(error)[:1].lower() + str(error)[1:]
        raise RefusedError(Reason.PAYLOAD, f"{what} is not base64: {why}: {text[:32]!r}") from error
    if binascii.b2a_base64(octets, newline=False) != text:
        raise RefusedError(Reason.PAYLOAD, f"{what} is not base64: bits are left over: {text[-8:]!r}")
    return octets


def _sender(front: bytes) -> str:
    """`vm` of `vm(2001): `, or nothing."""
    name, bracket, _ = front.rpartition(b"(")
    try:
        return source_of(name.decode()) if bracket else ""
    except UnicodeDecodeError:
        return ""
