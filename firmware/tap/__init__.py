"""Tap: receives a fleet's messages from a broker; several copies can share them.

Commands: v2n_tap.
"""
