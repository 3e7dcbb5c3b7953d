"""Code generator for ITS messages from ASN.1, used at build time.

Its packages are: importer of ASN.1 modules, model (schema), layout, back ends, and user-defined messages.
"""
