"""Swarm: many virtual stations that drive and send messages by the rules.

Face: swarm, audience, tracks, vehicle, messages.
"""
