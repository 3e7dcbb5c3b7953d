"""Time scales and leap seconds, shared by drivers, pps and firmware.

Face: scales, leaps, leap_list.
"""
