"""Client side of a station: sockets, sent and received messages, tables for terminals.

Face: client, arguments, received, listening, sending, show.
Commands: listen.
"""
