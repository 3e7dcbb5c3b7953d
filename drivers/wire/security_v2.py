"""Security envelope of ETSI TS 103 097 V1.2.1, version 2: header fields, payload, trailer.

The module verifies no signature and decrypts nothing. The standard's text was not available. The layout is that of
Vanetza's frames as tshark 4.0 dissects them. Comments in Vanetza cite clauses 4.2, 5 and 6 for it.
"""

from collections.abc import Iterator, Mapping

from board.runtime.errors import ProtocolError
from drivers.wire.oer import Walk, fixed

_ITS_AID, _SIGNER = 5, 128  # types of header fields
_CERTIFICATE = 2  # type of a signer
_SSP_LIST = 33  # type of a subject attribute: ITS-AIDs with their SSPs
_SIGNATURE = 1  # type of a trailer field
_SIGNED = 1
_PAYLOADS = {0: "unsecured", 2: "encrypted", 3: "external", 4: "encrypted"}


def unwrap_v2(octets: bytes) -> tuple[bytes, int, bytes]:
    """Return the signed payload, its ITS-AID (0 if no header field has it) and the SSP of the signer's certificate.

    The SSP is empty unless the signer is a single certificate with that ITS-AID; certificate chains are not searched.
    Raises ProtocolError if the payload is not signed, or a field is malformed or truncated; IndexError if the envelope
    is truncated between two fields.
    """
    start, end = _vector(octets, 1)
    its_aid, signer = 0, None
    for at in _elements(_HEADER_FIELD, octets, start, end):
        if octets[at] == _ITS_AID:
            its_aid, _ = _number(octets, at + 1)
        elif octets[at] == _SIGNER:
            signer = at + 1
    if octets[end] != _SIGNED:
        raise ProtocolError(f"security: {_PAYLOADS.get(octets[end], 'unknown')} payload (type {octets[end]})")
    start, end = _vector(octets, end + 1)
    trailer = _vector(octets, end)
    if _SIGNATURE not in [octets[at] for at in _elements(_TRAILER_FIELD, octets, *trailer)]:
        raise ProtocolError("security: no signature in the trailer")
    return octets[start:end], its_aid, b"" if signer is None else _ssp(octets, signer, its_aid)


def _ssp(octets: bytes, signer: int, its_aid: int) -> bytes:
    """Return the SSP for an ITS-AID from the signer's certificate; empty without one."""
    if octets[signer] != _CERTIFICATE:
        return b""
    for attribute in _elements(_ATTRIBUTE, octets, *_vector(octets, _subject(octets, signer + 1))):
        if octets[attribute] == _SSP_LIST:
            for entry in _elements(_PERMISSION, octets, *_vector(octets, attribute + 1)):
                number, at = _number(octets, entry)
                if number == its_aid:
                    start, end = _vector(octets, at)
                    return octets[start:end]
    return b""


# -- parsers that return the start and the end of a value


def _number(octets: bytes, at: int) -> tuple[int, int]:
    """Parse an IntX: return its value and its end.

    The number of leading ones in the first octet is the number of octets after it.
    """
    following = 8 - (octets[at] ^ 0xFF).bit_length()
    end = at + 1 + following
    return int.from_bytes(octets[at:end]) & (1 << 7 * (following + 1)) - 1, end


def _vector(octets: bytes, at: int) -> tuple[int, int]:
    """Return start and end of the content of a variable-length vector, after its length."""
    size, start = _number(octets, at)
    if start + size > len(octets):
        raise ProtocolError(f"security: truncated after {len(octets)} octets")
    return start, start + size


def _elements(element: Walk, octets: bytes, at: int, end: int) -> Iterator[int]:
    """Yield the start of each element of a vector. Raises ProtocolError if an element exceeds the vector."""
    while at < end:
        after = element(octets, at)
        if after > end:
            raise ProtocolError(f"security: a field is {after - end} octets longer than what holds it")
        yield at
        at = after


def _opaque(octets: bytes, at: int) -> int:
    return _vector(octets, at)[1]


# -- walks: each takes the start of a value and returns its end


def _tagged(known: Mapping[int, Walk]) -> Walk:
    """Return the walk over a value whose first octet selects its type.

    A value of unknown type is taken as a variable-length vector.
    """
    return lambda octets, at: known.get(octets[at], _opaque)(octets, at + 1)


def _pair(first: Walk, second: Walk) -> Walk:
    return lambda octets, at: second(octets, first(octets, at))


def _refused(what: str) -> Walk:
    def walk(octets: bytes, at: int) -> int:
        raise ProtocolError(f"security: {what}")

    return walk


def _its_aid(octets: bytes, at: int) -> int:
    return _number(octets, at)[1]


_PERMISSION = _pair(_its_aid, _opaque)  # ItsAidSsp
_NOTHING, _DIGEST, _FOREIGN_DIGEST = fixed(0), fixed(8), fixed(9)
_POINT = _tagged({0: fixed(32), 2: fixed(32), 3: fixed(32), 4: fixed(64)})  # elliptic curve point of NIST P-256
_SIGNED_BY = _tagged({0: _pair(_POINT, fixed(32))})
_PUBLIC_KEY = _tagged({0: _POINT, 1: _pair(fixed(1), _POINT)})
# Other attributes are vectors, such as the lists of ITS-AIDs.
_ATTRIBUTE = _tagged({0: _PUBLIC_KEY, 1: _PUBLIC_KEY, 2: fixed(1), 3: _POINT})
# Refused, because with nested certificates the peer would control the depth of recursion.
_NESTED = _refused("a certificate in a certificate")
_ISSUER = _tagged({0: _NOTHING, 1: _DIGEST, 2: _NESTED, 3: _NESTED, 4: _FOREIGN_DIGEST})


def _subject(octets: bytes, at: int) -> int:
    """Return the start of the subject attributes: after version, issuer, type and name of the subject."""
    return _opaque(octets, _ISSUER(octets, at + 1) + 1)


def _certificate(octets: bytes, at: int) -> int:
    attributes = _opaque(octets, _subject(octets, at))
    validity = _opaque(octets, attributes)
    return _SIGNED_BY(octets, validity)


_ENCRYPTED = _refused("encrypted data")
_HEADER_FIELD = _tagged(
    {
        0: fixed(8),  # generation time
        1: fixed(9),  # generation time with standard deviation
        2: fixed(4),  # expiration
        3: fixed(10),  # generation location
        4: _opaque,  # request of unrecognized certificates
        _ITS_AID: _its_aid,
        _SIGNER: _tagged({0: _NOTHING, 1: _DIGEST, _CERTIFICATE: _certificate, 3: _opaque, 4: _FOREIGN_DIGEST}),
        129: _ENCRYPTED,  # encryption parameters
        130: _ENCRYPTED,  # recipients
    }
)
_TRAILER_FIELD = _tagged({_SIGNATURE: _SIGNED_BY})
