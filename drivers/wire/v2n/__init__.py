"""V2N messages by a broker: profiles, topics, payloads, and messages between station and MQTT process.

Face: profile, description, message, talk, topic.
"""
