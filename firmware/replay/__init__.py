"""Replay of recordings and emulation of a lossy link.

Face: ending, ends, reasons.
Commands: replay, impair.
"""
