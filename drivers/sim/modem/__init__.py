"""Simulated SIM8202G modem at the far end of an AT port: commands, card and network.

Face: modem, network.
"""
