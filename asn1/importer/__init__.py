"""Importer: converts ASN.1 modules of standards and users to a schema.

Face: standards, crosscheck, feasible, parser, resolver.
"""
