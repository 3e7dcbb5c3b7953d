"""User-defined messages: files, imports, and their ITS PDU header.

Face: add, station.
"""
