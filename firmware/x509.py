"""Validity of X.509 certificates, read from PEM or DER."""

import re
import ssl
from datetime import UTC, datetime
from typing import NamedTuple

from board.runtime.errors import ProtocolError

BLOCK = re.compile(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)

# DER tags by X.690, as RFC 5280, clause 4.1 uses them.
SEQUENCE, UTC_TIME, GENERALIZED_TIME, VERSION = 0x30, 0x17, 0x18, 0xA0
FORMATS = {UTC_TIME: "%y%m%d%H%M%SZ", GENERALIZED_TIME: "%Y%m%d%H%M%SZ"}


class Validity(NamedTuple):
    """Validity of a certificate: notBefore and notAfter."""

    begin: datetime
    end: datetime


def validities(pem: str) -> list[Validity]:
    """Return the validity of each certificate in the text of a PEM file, in the order of the file.

    Raises ProtocolError if a certificate is damaged.
    """
    try:
        return [validity(ssl.PEM_cert_to_DER_cert(block)) for block in BLOCK.findall(pem)]
    except ValueError as error:
        raise ProtocolError(f"a certificate is damaged: {error}") from error


def period(found: list[Validity], is_any: bool) -> Validity:
    """Return the common validity of several certificates.

    is_any  True: the period in which any of them may be valid, for authorities. False: the period in which all are
            valid, for a chain.
    """
    begins, ends = [one.begin for one in found], [one.end for one in found]
    return Validity(min(begins), max(ends)) if is_any else Validity(max(begins), min(ends))


def validity(certificate: bytes) -> Validity:
    """Return the validity of a certificate in DER. Source: RFC 5280, clauses 4.1 and 4.1.2.5.

    Raises ProtocolError if it is truncated or not an X.509 certificate.
    """
    _, whole, _ = _take(certificate, SEQUENCE)
    _, rest, _ = _take(whole, SEQUENCE)
    if rest[:1] == bytes((VERSION,)):
        _, _, rest = _take(rest)
    for _ in ("serialNumber", "signature", "issuer"):
        _, _, rest = _take(rest)
    _, times, _ = _take(rest, SEQUENCE)
    begin_tag, begin, after = _take(times)
    end_tag, end, _ = _take(after)
    return Validity(_moment("notBefore", begin_tag, begin), _moment("notAfter", end_tag, end))


def _moment(name: str, tag: int, text: bytes) -> datetime:
    try:
        return datetime.strptime(text.decode("ascii"), FORMATS[tag]).replace(tzinfo=UTC)
    except (KeyError, ValueError) as error:
        raise ProtocolError(f"its {name}: invalid time: {text.hex()}") from error


def _take(octets: bytes, wanted: int | None = None) -> tuple[int, bytes, bytes]:
    """Return tag and contents of the first DER element, and the octets after it.

    Raises ProtocolError if the element is truncated or does not have the wanted tag.
    """
    if len(octets) < 2:
        raise ProtocolError("the certificate ends too early")
    tag, size, start = octets[0], octets[1], 2
    if size & 0x80:
        start += size & 0x7F
        size = int.from_bytes(octets[2:start])
    if len(octets) < start + size or (wanted is not None and tag != wanted):
        raise ProtocolError("the certificate is damaged")
    return tag, octets[start : start + size], octets[start + size :]
