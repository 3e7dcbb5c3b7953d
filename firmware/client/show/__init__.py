"""Display of a station's status by commands.

Face: failures, sparkline, status, table, tally.
Commands: time.
"""
