"""Corrections of a receiver: RTCM 3 frames from a file or a TCP server.

Face: source.
"""
