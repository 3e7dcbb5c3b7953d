"""Credentials of an MQTT client: reads certificates, keys and passwords at each connect.

Therefore a user may renew them while the station runs.
"""

import codecs
import os
import re
import ssl

from board.runtime.errors import InterfaceError
from drivers.mqtt.options import MqttOptions, check_file

MAX_PASSWORD = 65535  # octets: limit of a field in CONNECT, whose length has 16 bits
MAX_KEY = 1 << 20  # most octets read of a file without valid PEM content, to find the cause

# By option: content of the file, openssl command for it, and its first line in PEM form (RFC 7468).
_CERTIFICATE = ("certificate", "x509", "BEGIN CERTIFICATE")
_FORMS = {"ca": _CERTIFICATE, "certificate": _CERTIFICATE, "key": ("key", "pkey", "BEGIN PRIVATE KEY")}

_BEGIN = {
    "certificate": re.compile(rb"-----BEGIN CERTIFICATE-----"),  # does not match a certificate request
    "key": re.compile(rb"-----BEGIN (\w+ )?PRIVATE KEY-----"),  # also "RSA PRIVATE KEY", as OpenSSL 1 writes it
}
_UTF_16 = b"B\0E\0G\0I\0N"  # part of BEGIN in UTF-16 that is the same in both octet orders
# OpenSSL's errors for a wrong key: of the same algorithm as the certificate's key, and of another algorithm.
_OTHER_KEY = ("KEY_VALUES_MISMATCH", "NO_CERTIFICATE_ASSIGNED")


def context(settings: MqttOptions) -> ssl.SSLContext:
    """Return a TLS context for the settings: TLS 1.2 or later, and checks of the broker's certificate and host name.

    Raises InterfaceError if a file cannot be read or is not PEM, or if certificate and key do not match.
    """
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
    """Return the first line of password_file, without the byte order mark that some editors write.

    Raises InterfaceError if the file cannot be read, is UTF-16, or has an empty first line or one above MAX_PASSWORD.
    """
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
        raise InterfaceError(f"password_file {path}: the first line is empty or too long", "write the password into it")
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
        # Without this argument OpenSSL would ask on a terminal for the password of an encrypted key.
        made.load_cert_chain(certificate, key, password="")
    except ssl.SSLError as error:
        raise _refused(certificate, key, "" if error.library == "PEM" else error.reason or "") from error
    except OSError as error:
        # The error does not say which of the two files it concerns.
        path, name = (key, "key") if os.access(certificate, os.R_OK) else (certificate, "certificate")
        raise _unreadable(name, path, error) from error


def _refused(certificate: str, key: str, reason: str) -> InterfaceError:
    """Return the error for a certificate and key that OpenSSL refuses; it names the file at fault.

    reason  OpenSSL's own reason; empty if it gives none.
    """
    if reason in _OTHER_KEY:
        hint = "name the key that the certificate was made for"
        return InterfaceError(f"key {key}: is not the key of certificate {certificate}", hint)
    if reason:
        words = reason.replace("_", " ").lower()
        hint = "get a new certificate with a longer key and a newer hash"
        return InterfaceError(f"certificate {certificate}: this machine's TLS library refuses it: {words}", hint)
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(certificate)
    except ssl.SSLError:
        return _not_pem("certificate", certificate)
    if b"ENCRYPTED" in _octets(key):
        hint = f"the station cannot ask for its password; decrypt it: openssl pkey -in {key} -out {key}.plain"
        return InterfaceError(f"key {key}: is encrypted", hint)
    return _not_pem("key", key)


def _not_pem(name: str, path: str) -> InterfaceError:
    what, command, begin = _FORMS[name]
    octets = _octets(path)
    if octets[:1] == b"\x30" and not octets.isascii():  # tag of a SEQUENCE (X.690), with which DER content starts
        pem = f"{os.path.splitext(path)[0]}.pem"
        hint = f"convert it to PEM: openssl {command} -inform DER -in {path} -out {pem}"
        return InterfaceError(f"{name} {path}: is in DER form", hint)
    if _UTF_16 in octets:
        return InterfaceError(f"{name} {path}: is UTF-16", "save it as UTF-8")
    if _BEGIN[what].search(octets):
        return InterfaceError(f"{name} {path}: is truncated or damaged", "copy it again")
    return InterfaceError(f"{name} {path}: contains no {what} in PEM form", f"name a file that contains {begin}")


def _octets(path: str) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read(MAX_KEY)
    except OSError:
        return b""


def _unreadable(name: str, path: str, error: OSError) -> InterfaceError:
    return InterfaceError(f"{name} {path}: {error.strerror}", f"correct option {name}, or put the file there")
