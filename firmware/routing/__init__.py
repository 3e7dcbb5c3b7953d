"""Routing of messages: interfaces, stages, policy, queues and counters.

Face: router, interface, policy, duplicates, drops, options.
"""
