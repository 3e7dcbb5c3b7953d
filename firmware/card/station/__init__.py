"""Station's part of the owner's files.

Face: part, given.
"""
