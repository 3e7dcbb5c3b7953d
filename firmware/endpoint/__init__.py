"""Endpoint for users and peers: ports, ipc and control sockets, limits for peers.

Face: endpoint, users, report, ipc, control, peers.
"""
