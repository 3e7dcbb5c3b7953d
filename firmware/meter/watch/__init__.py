"""Observation of stations by the meter: reports and messages over the network.

Face: station, status_fields.
"""
