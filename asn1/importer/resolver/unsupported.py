"""Unsupported types with their clauses. They are parsed, and refused with their line."""

from asn1.importer.parser.fault import ImportFault, Place, fault

CLAUSES = {
    "REAL": "X.680 21", "EXTERNAL": "X.680 37", "EMBEDDED PDV": "X.680 36", "CHARACTER STRING": "X.680 44",
    "OID-IRI": "X.680 34", "RELATIVE-OID-IRI": "X.680 35", "DATE": "X.680 38", "TIME": "X.680 38",
    "TIME-OF-DAY": "X.680 38", "DATE-TIME": "X.680 38", "DURATION": "X.680 38", "GeneralizedTime": "X.680 46",
    "UTCTime": "X.680 47", "ObjectDescriptor": "X.680 48", "SET": "X.680 27", "ANY": "X.680 17",
    "INSTANCE": "X.680 17", "BMPString": "X.680 41", "GeneralString": "X.680 41", "GraphicString": "X.680 41",
    "TeletexString": "X.680 41", "T61String": "X.680 41", "UniversalString": "X.680 41", "VideotexString": "X.680 41",
}  # fmt: skip


def unsupported(place: Place, name: str) -> ImportFault:
    """Return the error for an unsupported type."""
    return fault(place, f"unsupported: {name}", CLAUSES[name])
