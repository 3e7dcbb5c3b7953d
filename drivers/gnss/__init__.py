"""Driver for GNSS receivers: u-blox of generation 9, any with NMEA, or a surveyed position without receiver.

Face: driver, bus.
"""
