"""Why a web server cannot be reached, in words, and what to do."""

import errno
import http.client
import socket
import ssl
import time
from typing import NamedTuple

from firmware.made_up import is_clock_set

NOBODY = "correct the address, or is the server gone, or the network?"
ASK = "ask whoever runs the server"
_ADDRESS = "correct the address"
_HOST = "correct the host in the address"
_NET = "is the network there? captain doctor"
_KNOWN = "the authorities are those of the image"
_NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID


class Trouble(NamedTuple):
    """words: what has happened. hint: what to do."""

    words: str
    hint: str


# X.509 verification, by X509_V_ERR_* of openssl/x509_vfy.h.
_CERTIFICATE = {
    _NOT_YET_VALID: Trouble("its certificate is not valid yet", "look at the clock of this box: captain time"),
    10: Trouble("its certificate has expired", "the server needs a new one, or this box's clock is wrong"),
    18: Trouble("its certificate is signed by itself, and by no authority that is known here", _KNOWN),
    19: Trouble("its certificate is signed by an authority that is not known here", _KNOWN),
    20: Trouble("its certificate is signed by an authority that is not known here", _KNOWN),
    21: Trouble("its certificate is signed by an authority that is not known here", _KNOWN),
    62: Trouble("its certificate is for another host", _HOST),
    64: Trouble("its certificate is not for this address", "write the host's name"),
}
_NO_TLS = ("WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE")  # reasons of OpenSSL 3.0, and of 3.2 and later
_NETWORK = {
    errno.ECONNREFUSED: Trouble("refuses the connection; nobody listens there", NOBODY),
    errno.EHOSTUNREACH: Trouble("no route to it", _NET),
    errno.ENETUNREACH: Trouble("no route to it", _NET),
    errno.EADDRNOTAVAIL: Trouble("this box has no address to reach it from", _NET),
    errno.ECONNRESET: Trouble("has closed the connection", NOBODY),
    errno.EPIPE: Trouble("has closed the connection", NOBODY),
    errno.ETIMEDOUT: Trouble("does not answer any more", NOBODY),
}
_NAMES = {
    socket.EAI_NONAME: Trouble("there is no host of this name", _HOST),
    socket.EAI_AGAIN: Trouble("no name server answers", _NET),
    getattr(socket, "EAI_NODATA", -5): Trouble("this name has no address", _HOST),
}


def trouble(error: Exception, wait_s: float) -> Trouble:
    """What a connection ended with, or why there is none. wait_s: how long an answer was waited for."""
    match error:
        case http.client.IncompleteRead():
            return Trouble("the connection has ended too early", NOBODY)
        case http.client.RemoteDisconnected():
            return Trouble("has closed the connection", NOBODY)
        case http.client.BadStatusLine():
            return Trouble(f"what answers there is no web server: it says {str(error).strip()[:60]!r}", _ADDRESS)
        case http.client.HTTPException():
            return Trouble("what answers there is no web server", _ADDRESS)
        case ssl.SSLCertVerificationError():
            return _distrusted(error)
        case ssl.SSLEOFError() | ssl.SSLZeroReturnError():
            return Trouble("has closed the connection", NOBODY)
        case ssl.SSLError() if error.reason in _NO_TLS:
            return Trouble("what answers there does not speak TLS", "is it an address with http://?")
        case ssl.SSLError():
            return Trouble(f"TLS fails: {(error.reason or error.strerror or '').replace('_', ' ').lower()}", ASK)
        case socket.gaierror():
            return _NAMES.get(error.errno or 0, Trouble(f"its name cannot be looked up: {error.strerror}", _NET))
        case TimeoutError() if error.errno is None:
            return Trouble(f"nothing came for {wait_s:.0f} s", NOBODY)
        case OSError():
            said = error.strerror or str(error) or "the connection has failed"
            return _NETWORK.get(error.errno or 0, Trouble(said, _NET))
    return Trouble(str(error), NOBODY)


def _distrusted(error: ssl.SSLCertVerificationError) -> Trouble:
    if error.verify_code == _NOT_YET_VALID and not is_clock_set():
        now = time.strftime("%Y-%m-%d", time.gmtime())
        return Trouble(
            f"the server's certificate is not valid yet, for the clock of this box was not set: it says {now}",
            "wait for a receiver or a server to set it (captain time), or copy the bundle here by ssh",
        )
    refused = Trouble(f"its certificate is refused here: {error.verify_message}", _KNOWN)
    return _CERTIFICATE.get(error.verify_code, refused)
