"""Peers of the endpoint: connections, and limits for hostile ones.

Face: limits, door, guard, connection, interest.
"""
