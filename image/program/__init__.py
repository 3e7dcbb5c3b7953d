"""Frozen program captain, and its Debian package.

Face: programs, freezing, frozen, licences, contents.
"""
