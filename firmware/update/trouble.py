"""Connection failures of a web server, in words, with remedies."""

import http.client
import socket
import ssl
import time
from typing import NamedTuple

from firmware.clock.clock_set import is_clock_set

NOBODY = "check the address, the server and the network (captain doctor)"
ASK = "ask the operator of the server"
_NET = "check the network: captain doctor"
_HOST = "correct the host in the address"
_NO_TLS = ("WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE")  # reasons in OpenSSL 3.0 and 3.2 if a server has no TLS
_ISSUER = (18, 19, 20, 21)  # X509_V_ERR_*: self-signed, or by an unknown authority
_NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID
_OTHER_HOST = (62, 64)  # X509_V_ERR_HOSTNAME_MISMATCH, _IP_ADDRESS_MISMATCH


class Trouble(NamedTuple):
    """Failure in words (words), and its remedy (hint)."""

    words: str
    hint: str


def trouble(error: Exception, wait_s: float) -> Trouble:
    """Return cause and remedy of a failed connection. wait_s: timeout that was used, in seconds."""
    match error:
        case ssl.SSLCertVerificationError():
            return _distrusted(error)
        case ConnectionRefusedError():
            return Trouble("refuses the connection", NOBODY)
        case ConnectionError() | ssl.SSLEOFError() | ssl.SSLZeroReturnError() | http.client.IncompleteRead():
            return Trouble("closed the connection", NOBODY)
        case ssl.SSLError():
            hint = f"write http:// if the server offers no https; else {ASK}" if error.reason in _NO_TLS else ASK
            return Trouble(f"TLS fails: {(error.reason or error.strerror or '').replace('_', ' ').lower()}", hint)
        case socket.gaierror():
            is_name = error.errno in (socket.EAI_NONAME, socket.EAI_NODATA)
            return Trouble(f"its name does not resolve: {error.strerror}", _HOST if is_name else _NET)
        case TimeoutError():
            return Trouble(f"timeout: no data for {wait_s:.0f} s", NOBODY)
        case OSError():
            return Trouble(error.strerror or "the connection failed", _NET)
    return Trouble("this is not a web server", "correct the address")


def _distrusted(error: ssl.SSLCertVerificationError) -> Trouble:
    """Return cause and remedy for a rejected certificate. Source of the codes: openssl/x509_vfy.h."""
    if error.verify_code in _ISSUER:
        what = "its certificate is signed by an unknown authority"
        return Trouble(what, "the image has the usual public authorities; copy the bundle here by ssh")
    if error.verify_code == _NOT_YET_VALID and not is_clock_set():
        now = time.strftime("%Y-%m-%d", time.gmtime())
        return Trouble(
            f"the server's certificate is not valid yet, because the clock of this box is not set: {now}",
            "wait until a receiver or an NTP server sets it (captain time), or copy the bundle here by ssh",
        )
    hint = _HOST if error.verify_code in _OTHER_HOST else f"check the clock (captain time); else {ASK}"
    return Trouble(f"its certificate is rejected: {error.verify_message}", hint)
