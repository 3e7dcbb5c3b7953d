"""Slots: power, device and driver of each; actions when one is missing.

Face: supervisor, states.
"""
