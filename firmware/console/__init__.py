"""Status screen for a serial console of 80 columns, 24 lines, 115200 baud.

Face: console, terminal.
"""
