"""The process with the MQTT client: one session with one broker.

Face: process, network, settings, credentials, trouble, backoff.
"""
