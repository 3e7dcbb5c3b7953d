"""Frozen program captain, its Debian packages with their repository, and its OCI image.

Face: programs, repository, freezing, frozen, licences, contents.
"""
