"""Why a broker cannot be reached, in words that say what to do: TLS, names and the network, each by its own name."""

import errno
import socket
import ssl

from board.errors import StationError
from drivers.mqtt_broker import broker
from drivers.mqtt_options import MqttOptions

# X.509 verification, by X509_V_ERR_* of openssl/x509_vfy.h.
_CERTIFICATE = {
    9: "its certificate is not valid yet; look at the clock of this machine",
    10: "its certificate has expired; the broker needs a new one, or this machine's clock is wrong",
    18: "its certificate is signed by itself, and by no authority that is known here; name it in ca",
    19: "its certificate is signed by an authority that is not known here; name that one's certificate in ca",
    20: "its certificate is signed by an authority that is not known here; name that one's certificate in ca",
    21: "its certificate is signed by an authority that is not known here; name that one's certificate in ca",
    23: "its certificate is revoked; do not trust this broker",
    62: "its certificate is for another host; correct the host in url, or the broker needs another one",
    64: "its certificate is not for this address; write the host's name in url",
}

# Alerts that the broker sends, by their reasons in OpenSSL (RFC 8446, clause 6).
_NO_CERTIFICATE = "asks for a certificate of this client; name one in certificate and key"
_ALERTS = {
    "TLSV13_ALERT_CERTIFICATE_REQUIRED": _NO_CERTIFICATE,
    "TLSV1_ALERT_UNKNOWN_CA": "knows no authority that has signed the certificate of this client; take another one",
    "SSLV3_ALERT_CERTIFICATE_EXPIRED": "refuses the certificate of this client: it has expired; renew it",
    "SSLV3_ALERT_CERTIFICATE_REVOKED": "refuses the certificate of this client: it is revoked; take another one",
    "SSLV3_ALERT_CERTIFICATE_UNKNOWN": "refuses the certificate of this client; take another one",
    "SSLV3_ALERT_BAD_CERTIFICATE": "refuses the certificate of this client: it is damaged; take another one",
    "SSLV3_ALERT_UNSUPPORTED_CERTIFICATE": "refuses the certificate of this client: its kind; take another one",
    "TLSV1_ALERT_ACCESS_DENIED": "refuses the certificate of this client: it may not connect; ask who runs the broker",
    "TLSV1_ALERT_DECRYPT_ERROR": "refuses the certificate of this client: its signature; take another one",
}
_OLD = "speaks no TLS of version 1.2 or later; the broker needs a newer one"
_OLD_VERSION = frozenset(
    ("TLSV1_ALERT_PROTOCOL_VERSION", "UNSUPPORTED_PROTOCOL", "WRONG_SSL_VERSION", "UNKNOWN_PROTOCOL", "VERSION_TOO_LOW")
)
_PLAIN = "answers without TLS at this port; correct the port in url"
_NOT_TLS = frozenset(("WRONG_VERSION_NUMBER", "HTTP_REQUEST", "RECORD_LAYER_FAILURE", "PACKET_LENGTH_TOO_LONG"))
_ENDS = "ends the connection during the TLS handshake; is TLS spoken at this port?"

_CLOSED = "has closed the connection"

_NETWORK = {
    errno.ECONNREFUSED: "refuses the connection; no broker listens there",
    errno.EHOSTUNREACH: "no route to it; is the network there?",
    errno.ENETUNREACH: "no route to it; is the network there?",
    errno.EADDRNOTAVAIL: "this machine has no address to reach it from",
    errno.ECONNRESET: _CLOSED,
    errno.EPIPE: _CLOSED,
    errno.ECONNABORTED: _CLOSED,
    errno.ETIMEDOUT: "does not answer any more",
    errno.EPERM: "this machine's rules forbid the connection; look at firewall and device",
    errno.EACCES: "this machine's rules forbid the connection; look at firewall and device",
}

_AWAY = frozenset((errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN, errno.EADDRNOTAVAIL))

_NAMES = {
    socket.EAI_NONAME: "there is no host of this name; correct the host in url",
    socket.EAI_AGAIN: "no name server answers; is the network there?",
    socket.EAI_FAIL: "the name server cannot say where this host is",
    getattr(socket, "EAI_NODATA", -5): "this name has no address; correct the host in url",
}

_LOGIN = "correct username and password_file, or ask who runs the broker"

# Reason codes of CONNACK, PUBACK, SUBACK and DISCONNECT (MQTT 5.0, clause 2.4) that somebody can do something about.
_REMEDIES = {
    "Unsupported protocol version": 'set version = "3.1.1"',
    "Client identifier not valid": "set another client_id",
    "Bad user name or password": _LOGIN,
    "Not authorized": "ask who runs the broker what this client may do",
    "Session taken over": "another client has the same client_id: set another one here or there",
    "Banned": "ask who runs the broker",
    "Quota exceeded": "the broker has enough of this client",
    "Packet too large": "the broker takes shorter messages",
}


def why(error: Exception, is_handshake: bool = False) -> str:
    """What a connection ended with, or why there is none.

    is_handshake  the error is of a TLS handshake, before anything else was said.
    """
    if isinstance(error, EOFError):
        return _CLOSED
    if isinstance(error, StationError):
        return f"{error.message}; {error.hint}" if error.hint else error.message
    if isinstance(error, ssl.SSLCertVerificationError):
        return _CERTIFICATE.get(error.verify_code, f"its certificate is refused here: {error.verify_message}")
    if isinstance(error, ssl.SSLError):
        return _of_tls(error, is_handshake)
    if isinstance(error, socket.gaierror):
        return _NAMES.get(error.errno or 0, f"its name cannot be looked up: {error.strerror}")
    if is_handshake and isinstance(error, ConnectionError):
        return _ENDS
    if isinstance(error, OSError):
        return _NETWORK.get(error.errno or 0, error.strerror or str(error) or type(error).__name__)
    return str(error)


def is_away(error: Exception) -> bool:
    """Whether this machine has no network: nobody was asked."""
    if isinstance(error, socket.gaierror):
        return error.errno == socket.EAI_AGAIN
    return isinstance(error, OSError) and error.errno in _AWAY


def is_cut(error: Exception) -> bool:
    """Whether a connection has ended without either end wanting it."""
    return is_away(error) or (isinstance(error, OSError) and error.errno == errno.ETIMEDOUT)


def soon(words: str) -> str:
    """The same for a connection that did not last: a broker closes the older one of two that have one name."""
    if words != _CLOSED:
        return words
    return f"{words} soon after CONNACK: it was stopped, or another client has the same client_id; its log says which"


def early(words: str, settings: MqttOptions) -> str:
    """The same for a connection that was not accepted: brokers often close it without a reason."""
    if words != _CLOSED:
        return words
    if not broker(settings.url).has_tls:
        return f"{words} before CONNACK; if it wants TLS, write mqtts:// in url"
    if not settings.certificate:
        return f"{words} before CONNACK; if it {_NO_CERTIFICATE}"
    return f"{words} before CONNACK; its log may say why"


def _of_tls(error: ssl.SSLError, is_handshake: bool) -> str:
    reason = error.reason or ""
    if reason in _ALERTS:
        return _ALERTS[reason]
    if reason in _OLD_VERSION:
        return _OLD
    if reason == "SSLV3_ALERT_HANDSHAKE_FAILURE":
        return f"refuses the TLS handshake; if it {_NO_CERTIFICATE}"
    if is_handshake and reason in _NOT_TLS:
        return _PLAIN
    if isinstance(error, ssl.SSLEOFError | ssl.SSLZeroReturnError) or reason == "UNEXPECTED_EOF_WHILE_READING":
        return _ENDS if is_handshake else _CLOSED
    return f"TLS fails: {reason.replace('_', ' ').lower() or error.strerror}"


def refusal(words: str, detail: str = "", is_connack: bool = False) -> str:
    """A reason of the broker, as the client library calls it, with what it says itself and what can be done."""
    said = f"{words} ({detail})" if detail else words
    if is_connack and words == "Not authorized":  # brokers say so of a wrong password as well
        return f"{said}; {_LOGIN}"
    return f"{said}; {_REMEDIES[words]}" if words in _REMEDIES else said
