"""Checks of a station's requirements, one module per subject, each with remedies.

Commands: doctor.
"""
