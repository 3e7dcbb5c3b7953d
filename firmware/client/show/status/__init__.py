"""Text for parts of a status: board, clock, modules, storage.

Face: board, clock, modules, storage.
"""
