"""Attacks on the ports of a station, and what they cost it."""
