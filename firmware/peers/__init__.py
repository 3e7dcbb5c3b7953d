"""Peers of the endpoint: their connections, and limits for hostile ones. Face: connection, door, interest, limits."""
