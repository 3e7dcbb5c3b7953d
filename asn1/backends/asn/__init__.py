"""Output format asn: writes the schema as ASN.1 text, for other compilers.

Face: form, text.
"""
