"""Driver for UDP: bare PDUs, BTP packets or Ethernet frames in datagrams.

Face: driver.
"""
