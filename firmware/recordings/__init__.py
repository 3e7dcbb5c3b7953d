"""Recordings as files: pcap, pcapng and MCAP, with the PDUs inside.

Face: capture, layers, mcap, pcapng, reception.
"""
