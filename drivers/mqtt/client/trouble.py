"""Trouble with a broker: texts with a remedy for errors of TLS, name look-up and network."""

import errno
import socket
import ssl

from board.runtime.errors import StationError
from drivers.mqtt.broker import broker
from drivers.mqtt.options import MqttOptions

# Texts for errors of X.509 verification, by X509_V_ERR_* of openssl/x509_vfy.h.
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

# Texts for TLS alerts of the broker (RFC 8446, clause 6), by OpenSSL's name of the reason.
_NO_CERTIFICATE = "asks for a certificate of this client; name one in certificate and key"
_ALERTS = {
    "TLSV13_ALERT_CERTIFICATE_REQUIRED": _NO_CERTIFICATE,
    "TLSV1_ALERT_UNKNOWN_CA": "knows no authority that has signed the certificate of this client; take another one",
    "SSLV3_ALERT_CERTIFICATE_EXPIRED": "refuses the certificate of this client: it has expired; renew it",
    "SSLV3_ALERT_CERTIFICATE_REVOKED": "refuses the certificate of this client: it is revoked; take another one",
    "SSLV3_ALERT_CERTIFICATE_UNKNOWN": "refuses the certificate of this client; take another one",
    "SSLV3_ALERT_BAD_CERTIFICATE": "refuses the certificate of this client: it is damaged; take another one",
    "SSLV3_ALERT_UNSUPPORTED_CERTIFICATE": "refuses the certificate of this client: unsupported kind; take another one",
    "TLSV1_ALERT_ACCESS_DENIED": "refuses the certificate of this client: it may not connect; ask who runs the broker",
    "TLSV1_ALERT_DECRYPT_ERROR": "refuses the certificate of this client: invalid signature; take another one",
}
_OLD = "does not support TLS 1.2 or later; the broker needs a newer TLS library"
_OLD_VERSION = frozenset(
    ("TLSV1_ALERT_PROTOCOL_VERSION", "UNSUPPORTED_PROTOCOL", "WRONG_SSL_VERSION", "UNKNOWN_PROTOCOL", "VERSION_TOO_LOW")
)
_PLAIN = "answers without TLS at this port; correct the port in url"
_NOT_TLS = frozenset(("WRONG_VERSION_NUMBER", "HTTP_REQUEST", "RECORD_LAYER_FAILURE", "PACKET_LENGTH_TOO_LONG"))
_ENDS = "ends the connection during the TLS handshake; check that this port takes TLS"

_CLOSED = "has closed the connection"

_NETWORK = {
    errno.ECONNREFUSED: "refuses the connection; no broker listens there",
    errno.EHOSTUNREACH: "no route to it; check the network",
    errno.ENETUNREACH: "no route to it; check the network",
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
    socket.EAI_NONAME: "unknown host name; correct the host in url",
    socket.EAI_AGAIN: "no name server answers; check the network",
    socket.EAI_FAIL: "the name server cannot say where this host is",
    getattr(socket, "EAI_NODATA", -5): "this name has no address; correct the host in url",
}

# Reason code of a DISCONNECT after another client connected with the same client_id (MQTT 5.0, clause 3.14.2.1).
TAKEN_OVER = 0x8E

_LOGIN = "correct username and password_file, or ask who runs the broker"

# Remedies by reason code of CONNACK, PUBACK, SUBACK and DISCONNECT (MQTT 5.0, clause 2.4).
_REMEDIES = {
    "Unsupported protocol version": 'set version = "3.1.1"',
    "Client identifier not valid": "set another client_id",
    "Bad user name or password": _LOGIN,
    "Not authorized": "ask who runs the broker what this client may do",
    "Session taken over": "another client has the same client_id: set another one here or there",
    "Banned": "ask who runs the broker",
    "Quota exceeded": "this client has exceeded a quota of the broker",
    "Packet too large": "the broker takes shorter messages",
}


def why(error: Exception, is_handshake: bool = False) -> str:
    """Return the text for an error that ended a connection or a try to connect, with a remedy if there is one.

    is_handshake  the error occurred during the TLS handshake.
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
    """Return True if the error means that this machine has no network, so that no broker was reached."""
    if isinstance(error, socket.gaierror):
        return error.errno == socket.EAI_AGAIN
    return isinstance(error, OSError) and error.errno in _AWAY


def is_cut(error: Exception) -> bool:
    """Return True if the network has ended a connection, not the broker."""
    return is_away(error) or (isinstance(error, OSError) and error.errno == errno.ETIMEDOUT)


def soon(words: str) -> str:
    """Return the text for a connection that ended soon after CONNACK.

    A broker that closed it may have got a second connection with the same client_id: it then closes the older one.
    """
    if words != _CLOSED:
        return words
    return f"{words} soon after CONNACK: the broker stopped, or another client has the same client_id; see its log"


def early(words: str, settings: MqttOptions) -> str:
    """Return the text for a connection that ended before CONNACK.

    Brokers often close such a connection without a reason, so likely causes are added.
    """
    if words != _CLOSED:
        return words
    if not broker(settings.url).has_tls:
        return f"{words} before CONNACK; if the broker needs TLS, write mqtts:// in url"
    if not settings.certificate:
        return f"{words} before CONNACK; if the broker {_NO_CERTIFICATE}"
    return f"{words} before CONNACK; the broker's log may say why"


def _of_tls(error: ssl.SSLError, is_handshake: bool) -> str:
    reason = error.reason or ""
    if reason in _ALERTS:
        return _ALERTS[reason]
    if reason in _OLD_VERSION:
        return _OLD
    if reason == "SSLV3_ALERT_HANDSHAKE_FAILURE":
        return f"refuses the TLS handshake; if the broker {_NO_CERTIFICATE}"
    if is_handshake and reason in _NOT_TLS:
        return _PLAIN
    if isinstance(error, ssl.SSLEOFError | ssl.SSLZeroReturnError) or reason == "UNEXPECTED_EOF_WHILE_READING":
        return _ENDS if is_handshake else _CLOSED
    return f"TLS fails: {reason.replace('_', ' ').lower() or error.strerror}"


def refusal(words: str, detail: str = "", is_connack: bool = False) -> str:
    """Return the text of a refusal, with a remedy if there is one.

    words       name of the reason code, by the client library.
    detail      the broker's own explanation; empty without one.
    is_connack  the refusal is of the connection itself.
    """
    said = f"{words} ({detail})" if detail else words
    if is_connack and words == "Not authorized":  # brokers send this code for a wrong password as well
        return f"{said}; {_LOGIN}"
    return f"{said}; {_REMEDIES[words]}" if words in _REMEDIES else said
