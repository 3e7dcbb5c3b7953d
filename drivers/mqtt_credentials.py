"""What a client shows a broker and trusts: files of certificates, keys and passwords, read at each connect.

They may be renewed while the station runs.
"""

import codecs
import os
import ssl

from board.errors import InterfaceError
from drivers.mqtt_options import MqttOptions, check_file

MAX_PASSWORD = 65535  # octets: the length of a field of CONNECT
MAX_KEY = 1 << 20  # octets that are looked at of a file that holds none

# What a file holds, the command of openssl for it, and where it begins in PEM form (RFC 7468).
_CERTIFICATE = ("certificate", "x509", "BEGIN CERTIFICATE")
_FORMS = {"ca": _CERTIFICATE, "certificate": _CERTIFICATE, "key": ("key", "pkey", "BEGIN PRIVATE KEY")}


def context(settings: MqttOptions) -> ssl.SSLContext:
    """TLS as the settings say it: 1.2 at least, a known authority, the host's name. Raises InterfaceError."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    if settings.ca:
        _load_ca(made, settings.ca)
    else:
        made.load_default_certs()
    if settings.certificate:
        check_file("key", settings.key, is_secret=True)
        _load_own(made, settings.certificate, settings.key)
    return made


def password(settings: MqttOptions) -> bytes:
    """The first line of the file, without the mark that editors put before it. Raises InterfaceError."""
    path = settings.password_file
    check_file("password_file", path, is_secret=True)
    try:
        with open(path, "rb") as file:
            octets = file.read(MAX_PASSWORD + len(codecs.BOM_UTF8) + 2)
    except OSError as error:
        raise _unreadable("password_file", path, error) from error
    if octets.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InterfaceError(f"password_file {path}: is UTF-16", "save it as UTF-8")
    found = octets.removeprefix(codecs.BOM_UTF8).partition(b"\n")[0].removesuffix(b"\r")
    if not 0 < len(found) <= MAX_PASSWORD:
        raise InterfaceError(f"password_file {path}: its first line is no password", "write the password into it")
    return found


def _load_ca(made: ssl.SSLContext, path: str) -> None:
    try:
        made.load_verify_locations(path)
    except ssl.SSLError as error:
        raise _not_pem("ca", path) from error
    except OSError as error:
        raise _unreadable("ca", path, error) from error


def _load_own(made: ssl.SSLContext, certificate: str, key: str) -> None:
    try:
        # Without a password given here OpenSSL would ask a terminal for that of an encrypted key.
        made.load_cert_chain(certificate, key, password="")
    except ssl.SSLError as error:
        raise _refused(certificate, key, error.reason or "") from error
    except OSError as error:
        # It does not say which of the two.
        path, name = (key, "key") if os.access(certificate, os.R_OK) else (certificate, "certificate")
        raise _unreadable(name, path, error) from error


def _refused(certificate: str, key: str, reason: str) -> InterfaceError:
    """Which of the two OpenSSL does not take, as it often does not say itself. reason: its own, if it gives one."""
    if reason == "KEY_VALUES_MISMATCH":
        hint = "name the key that the certificate was made for"
        return InterfaceError(f"key {key}: is not the key of certificate {certificate}", hint)
    if reason:
        words = reason.replace("_", " ").lower()
        hint = "have another one made, of a longer key and a newer hash"
        return InterfaceError(f"certificate {certificate}: is not taken by TLS here: {words}", hint)
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(certificate)
    except ssl.SSLError:
        return _not_pem("certificate", certificate)
    if b"ENCRYPTED" in _octets(key):
        hint = f"nobody could be asked for its password; decrypt it: openssl pkey -in {key} -out {key}.plain"
        return InterfaceError(f"key {key}: is encrypted", hint)
    return _not_pem("key", key)


def _not_pem(name: str, path: str) -> InterfaceError:
    what, command, begin = _FORMS[name]
    octets = _octets(path)
    if octets[:1] == b"\x30" and not octets.isascii():  # a SEQUENCE (X.690)
        pem = f"{os.path.splitext(path)[0]}.pem"
        hint = f"PEM form is wanted: openssl {command} -inform DER -in {path} -out {pem}"
        return InterfaceError(f"{name} {path}: is in DER form", hint)
    return InterfaceError(f"{name} {path}: holds no {what} in PEM form", f"name a file with {begin} in it")


def _octets(path: str) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read(MAX_KEY)
    except OSError:
        return b""


def _unreadable(name: str, path: str, error: OSError) -> InterfaceError:
    return InterfaceError(f"{name} {path}: {error.strerror}", f"correct option {name}, or put the file there")
