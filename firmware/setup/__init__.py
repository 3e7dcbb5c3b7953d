"""Settings that a machine lacks for its board: finds, makes and reverts them.

Face: kept, setup, setting.
"""
