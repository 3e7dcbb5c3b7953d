"""GNSS receiver protocols: streams, sentences, fixes and time.

Face: fix, stream, time, nmea, nmea_epochs.
"""
