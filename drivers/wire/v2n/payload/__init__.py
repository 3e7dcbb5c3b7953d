"""Forms of payloads, with parsers for JSON of peers.

Face: plain, nap, orange.
"""
