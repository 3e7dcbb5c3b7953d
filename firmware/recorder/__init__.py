"""Recorder of a station: writes frames to files, and keeps those around an event.

Face: child.
Commands: record, extcap.
"""
