"""GeoNetworking protocol of an interface, with its state: EN 302 636-4-1 V1.4.1 (2020-01).

Face: protocol, header, packet, sender, own.
"""
