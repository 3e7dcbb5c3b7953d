"""Payloads with the PDU as octets, as base64, or in the form vcaptain."""

import binascii

from board.runtime.errors import ConfigurationError
from drivers.reason import Reason
from drivers.wire.v2n.message import RefusedError, Sending, source_of


class Binary:
    """Payload that is the PDU."""

    def write(self, sending: Sending) -> bytes:
        return sending.pdu

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        return payload, ""


class Base64:
    """Payload that is the PDU as base64 of RFC 4648, section 4."""

    def write(self, sending: Sending) -> bytes:
        return binascii.b2a_base64(sending.pdu, newline=False)

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        return from_base64(payload, "the payload"), ""


class VCaptain:
    """Payload `vm(2001): <AgIAAAU5AAECAw==>`: sender, BTP port, and the PDU as base64 in angle brackets.

    host  name of the station; its own messages are refused when they return.

    Raises ConfigurationError for a host that is empty, or has `<`, `>`, `(` or control characters.
    """

    def __init__(self, host: str) -> None:
        if not host or not host.isprintable() or set(host) & set("<>("):
            raise ConfigurationError(f"host: invalid in a payload: {host!r}", "leave ( < > and control characters out")
        self._host = host.encode()

    def write(self, sending: Sending) -> bytes:
        coded = binascii.b2a_base64(sending.pdu, newline=False)
        return b"%s(%d): <%s>" % (self._host, sending.btp_port, coded)

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        """Return the PDU between the first `<` and the next `>`, and the sender; any text may precede `<`.

        Raises RefusedError without brackets, for text that is not Base64, and for this station's own message.
        """
        front, opening, rest = payload.partition(b"<")
        coded, closing, _ = rest.partition(b">")
        if not opening or not closing:
            missing = ">" if opening else "<"
            raise RefusedError(Reason.PAYLOAD, f"the payload has no {missing}: {payload[:32]!r}")
        if front.startswith(self._host + b"("):
            raise RefusedError(Reason.OWN_ECHO, f"it is of this station: {front[:64]!r}")
        return from_base64(coded, "text in brackets"), _sender(front)


def from_base64(text: bytes, what: str) -> bytes:
    """Decode base64 strictly: no white space, standard alphabet, padding required, unused bits zero.

    Raises RefusedError for any other text. what: the name of the text in the message.
    """
    try:
        octets = binascii.a2b_base64(text, strict_mode=True)
    except binascii.Error as error:
        why = str(error)[:1].lower() + str(error)[1:]
        raise RefusedError(Reason.PAYLOAD, f"{what} is not base64: {why}: {text[:32]!r}") from error
    if binascii.b2a_base64(octets, newline=False) != text:
        raise RefusedError(Reason.PAYLOAD, f"{what} is not base64: bits are left over: {text[-8:]!r}")
    return octets


def _sender(front: bytes) -> str:
    """Return `vm` from `vm(2001): `; empty without a bracket."""
    name, bracket, _ = front.rpartition(b"(")
    try:
        return source_of(name.decode()) if bracket else ""
    except UnicodeDecodeError:
        return ""
