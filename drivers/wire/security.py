"""Envelope of a secured GeoNetworking packet: IEEE 1609.2 signed data in the profile of ETSI TS 103 097.

V1.3.1 and V2.1.1 of the profile have the same octets here; security_v2.py parses the envelope of V1.2.1. The module
verifies no signature and decrypts nothing. It walks over the whole envelope to its end, to detect truncation.
"""

from typing import NamedTuple

from board.runtime.errors import ProtocolError
from drivers.wire.oer import Field, Sequence, choice, content, counted, elements, fixed, sequence_of

MAX_SSP = 32  # octets; limit of RxSecurity

# --- Ieee1609Dot2BaseTypes (IEEE 1609.2-2022 clause 6.3.4 and following)
_NULL = fixed(0)
_LOCATION = fixed(8)  # TwoDLocation
_P256 = choice(fixed(32), _NULL, fixed(32), fixed(32), fixed(64))  # EccP256CurvePoint
_P256_SIGNATURE = Sequence(Field("r", _P256), Field("s", fixed(32)))
_SIGNATURE = choice(_P256_SIGNATURE, _P256_SIGNATURE, extensible=True)
_VERIFICATION_KEY = choice(_P256, _P256, extensible=True)
_PUBLIC_ENCRYPTION_KEY = Sequence(
    Field("algorithm", fixed(1)),
    Field("key", choice(_P256, _P256, extensible=True)),
)
_SYMMETRIC_KEY = choice(fixed(16), extensible=True)
_SUBREGIONS = Sequence(Field("region", fixed(1)), Field("subregions", sequence_of(fixed(2))))
_IDENTIFIED_REGION = choice(
    fixed(2),
    Sequence(Field("country", fixed(2)), Field("regions", sequence_of(fixed(1)))),
    Sequence(Field("country", fixed(2)), Field("regions", sequence_of(_SUBREGIONS))),
    extensible=True,
)
_REGION = choice(
    fixed(10),  # circular
    sequence_of(fixed(16)),  # rectangular
    sequence_of(_LOCATION),  # polygonal
    sequence_of(_IDENTIFIED_REGION),
    extensible=True,
)
_SSP = choice(counted, extensible=True)
_OPAQUE = 0x80  # tag of the alternative opaque in ServiceSpecificPermissions
_PSID_SSP = Sequence(Field("psid", counted), Field("ssp", _SSP, True))
_SSP_RANGE = choice(sequence_of(counted), _NULL, extensible=True)
_PSID_SSP_RANGE = Sequence(Field("psid", counted), Field("range", _SSP_RANGE, True))

# --- certificates (clause 6.4)
_GROUP_PERMISSIONS = Sequence(
    Field("subject", choice(sequence_of(_PSID_SSP_RANGE), _NULL, extensible=True)),
    Field("min_chain_length", counted, True),
    Field("chain_length_range", counted, True),
    Field("end_entity_type", fixed(1), True),
)
_LINKAGE = Sequence(
    Field("i", fixed(2)),
    Field("value", fixed(9)),
    Field("group", fixed(13), True),
)
_TO_BE_SIGNED_CERTIFICATE = Sequence(
    Field("id", choice(_LINKAGE, counted, counted, _NULL, extensible=True)),
    Field("craca_id", fixed(3)),
    Field("crl_series", fixed(2)),
    Field("validity", fixed(7)),  # octets: start 4, unit 1, duration 2
    Field("region", _REGION, True),
    Field("assurance", fixed(1), True),
    Field("permissions", sequence_of(_PSID_SSP), True),
    Field("issue_permissions", sequence_of(_GROUP_PERMISSIONS), True),
    Field("request_permissions", sequence_of(_GROUP_PERMISSIONS), True),
    Field("rollover", _NULL, True),
    Field("encryption_key", _PUBLIC_ENCRYPTION_KEY, True),
    Field("verify_key", choice(_VERIFICATION_KEY, _P256, extensible=True)),
    extensible=True,
)
_CERTIFICATE = Sequence(
    Field("version", fixed(1)),
    Field("type", fixed(1)),
    Field("issuer", choice(fixed(8), fixed(1), extensible=True)),
    Field("to_be_signed", _TO_BE_SIGNED_CERTIFICATE),
    Field("signature", _SIGNATURE, True),
)

# --- signed data (clause 6.3)
_UNSECURED = Sequence(Field("version", fixed(1)), Field("content", choice(counted)))  # other content is rejected
_PAYLOAD = Sequence(
    Field("data", _UNSECURED, True),
    Field("hash", choice(fixed(32), extensible=True), True),
    extensible=True,
)
_HEADER = Sequence(
    Field("psid", counted),
    Field("generation_time", fixed(8), True),
    Field("expiry_time", fixed(8), True),
    Field("generation_location", fixed(10), True),
    Field("learning_request", fixed(3), True),
    Field("missing_crl", Sequence(Field("id", fixed(5)), extensible=True), True),
    Field("encryption_key", choice(_PUBLIC_ENCRYPTION_KEY, _SYMMETRIC_KEY), True),
    extensible=True,
)
_CHAIN = 0x81  # tag of the alternative certificate in SignerIdentifier
_SIGNER = choice(fixed(8), sequence_of(_CERTIFICATE), _NULL, extensible=True)
_SIGNED = Sequence(
    Field("hash", fixed(1)),
    Field("payload", _PAYLOAD),
    Field("header", _HEADER),
    Field("signer", _SIGNER),
    Field("signature", _SIGNATURE),
)

_V2, _V3 = 2, 3  # protocol version, the first octet of either envelope
_SIGNED_DATA = 0x81  # tag of the alternative signedData in Ieee1609Dot2Content
_CONTENT = {0x80: "unsecured data", 0x82: "encrypted data", 0x83: "signed certificate request"}


class Unwrapped(NamedTuple):
    """Content of a signed packet.

    payload  signed octets: common header, extended header and the payload after them.
    its_aid  psid of the header; 0 if a version 2 envelope has none.
    ssp      SSP of the signer's certificate for this its_aid; empty if only a digest is present, or above 32 octets.
    """

    payload: bytes
    its_aid: int
    ssp: bytes


def unwrap(octets: bytes) -> Unwrapped:
    """Parse the envelope that follows a basic header; ignore octets after it.

    Raises ProtocolError if the content is not signed data with an embedded payload, or is truncated.
    Source: IEEE 1609.2-2022 clause 6.3, ETSI TS 103 097 V2.1.1 clause 5.2; V1.2.1 for version 2.
    """
    try:
        if octets[0] == _V2:
            # Imported late: rarely needed, and 0.5 % of the start-up time.
            from drivers.wire.security_v2 import unwrap_v2

            payload, its_aid, ssp = unwrap_v2(octets)
        else:
            payload, its_aid, ssp = _unwrap_v3(octets)
    except IndexError as error:
        raise ProtocolError(f"security: truncated after {len(octets)} octets") from error
    return Unwrapped(payload, its_aid, ssp if len(ssp) <= MAX_SSP else b"")


def _unwrap_v3(octets: bytes) -> tuple[bytes, int, bytes]:
    if octets[0] != _V3:
        raise ProtocolError(f"security: unknown version of the envelope: {octets[0]}")
    if octets[1] != _SIGNED_DATA:
        raise ProtocolError(f"security: {_CONTENT.get(octets[1], 'unknown content')} ({octets[1]:#04x})")
    signed = _SIGNED.places(octets, 2)
    if signed["end"] > len(octets):
        raise ProtocolError(f"security: truncated after {len(octets)} octets")
    data = _PAYLOAD.places(octets, signed["payload"]).get("data")
    if data is None:
        raise ProtocolError("security: external payload, of which the envelope has the hash only")
    its_aid = int.from_bytes(content(octets, signed["header"] + 1))  # the psid follows one octet of preamble
    return content(octets, data + 2), its_aid, _ssp(octets, signed["signer"], its_aid)


def _ssp(octets: bytes, signer: int, its_aid: int) -> bytes:
    """Return the SSP of the signer's first certificate for an ITS-AID; empty without one."""
    if octets[signer] != _CHAIN:
        return b""
    first, *others = elements(_CERTIFICATE, octets, signer + 1)
    if not others:
        return b""
    certificate = _CERTIFICATE.places(octets, first)
    permissions = _TO_BE_SIGNED_CERTIFICATE.places(octets, certificate["to_be_signed"]).get("permissions")
    if permissions is None:
        return b""
    *entries, _ = elements(_PSID_SSP, octets, permissions)
    for entry in entries:
        places = _PSID_SSP.places(octets, entry)
        if "ssp" in places and int.from_bytes(content(octets, places["psid"])) == its_aid:
            return _permission(octets, places["ssp"])
    return b""


def _permission(octets: bytes, at: int) -> bytes:
    """Return ServiceSpecificPermissions: opaque, or bitmapSsp inside an open type."""
    value = content(octets, at + 1)
    return value if octets[at] == _OPAQUE else content(value, 0)
