"""Shared parts of packet interfaces: kernel lanes, batches, GeoNetworking.

Face: access_category, datagrams, intake, lanes, geolink.
"""
