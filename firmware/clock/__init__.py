"""Station time: its source, its quality and its history.

Face: time_history, timekeeper, clock_set, receivers, own_time, pulse_input.
"""
