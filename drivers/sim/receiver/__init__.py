"""Simulated u-blox receiver at the far end of a line, with its properties.

Face: receiver, habits.
"""
