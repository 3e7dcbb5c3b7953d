"""Driver for MQTT, and its worker process with the client of a broker.

Face: driver, options, profile, broker, client.
"""
