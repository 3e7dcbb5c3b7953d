"""Why a web server cannot be reached, in words that say what to do."""

import errno
import http.client
import socket
import ssl

# X.509 verification, by X509_V_ERR_* of openssl/x509_vfy.h.
_CERTIFICATE = {
    9: "its certificate is not valid yet; look at the clock of this box: captain time",
    10: "its certificate has expired; the server needs a new one, or this box's clock is wrong",
    18: "its certificate is signed by itself, and by no authority that is known here",
    19: "its certificate is signed by an authority that is not known here",
    20: "its certificate is signed by an authority that is not known here",
    21: "its certificate is signed by an authority that is not known here",
    62: "its certificate is for another host; correct the host in the address",
    64: "its certificate is not for this address; write the host's name",
}
_NO_TLS = ("WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE")  # reasons of OpenSSL 3.0, and of 3.2 and later
_NETWORK = {
    errno.ECONNREFUSED: "refuses the connection; nobody listens there",
    errno.EHOSTUNREACH: "no route to it; is the network there?",
    errno.ENETUNREACH: "no route to it; is the network there?",
    errno.EADDRNOTAVAIL: "this box has no address to reach it from",
    errno.ECONNRESET: "has closed the connection",
    errno.EPIPE: "has closed the connection",
    errno.ETIMEDOUT: "does not answer any more",
}
_NAMES = {
    socket.EAI_NONAME: "there is no host of this name; correct the host in the address",
    socket.EAI_AGAIN: "no name server answers; is the network there?",
    getattr(socket, "EAI_NODATA", -5): "this name has no address; correct the host in the address",
}


def is_no_tls(error: ssl.SSLError) -> bool:
    """Whether something answers that is no TLS, such as plain HTTP."""
    return error.reason in _NO_TLS


def why(error: Exception, wait_s: float) -> str:
    """What a connection ended with, or why there is none. wait_s: how long an answer was waited for."""
    match error:
        case http.client.IncompleteRead():
            return "the connection has ended too early"
        case http.client.RemoteDisconnected():
            return "has closed the connection"
        case http.client.HTTPException():
            return f"what answers there is no web server: {error!r}"[:120]
        case ssl.SSLCertVerificationError():
            return _CERTIFICATE.get(error.verify_code, f"its certificate is refused here: {error.verify_message}")
        case ssl.SSLEOFError() | ssl.SSLZeroReturnError():
            return "has closed the connection"
        case ssl.SSLError() if is_no_tls(error):
            return "what answers there does not speak TLS"
        case ssl.SSLError():
            return f"TLS fails: {(error.reason or error.strerror or '').replace('_', ' ').lower()}"
        case socket.gaierror():
            return _NAMES.get(error.errno or 0, f"its name cannot be looked up: {error.strerror}")
        case TimeoutError() if error.errno is None:
            return f"nothing came for {wait_s:.0f} s"
        case OSError():
            return _NETWORK.get(error.errno or 0, error.strerror or str(error) or type(error).__name__)
    return str(error)
